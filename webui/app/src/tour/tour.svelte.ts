import type { Preference } from '../live/preference.svelte';
import type { Station } from '../live/station.svelte';
import type { Place } from '../page/place.svelte';
import { STEPS, type TourStep } from './steps';

/**
 * The tour of a new person. It is offered until this browser has seen its person begin or decline
 * it, and can be begun again at any time. Whoever goes to another page by themselves ends it.
 */
export class Tour {
  #index = $state<number | null>(null);
  readonly #station: Station;
  readonly #preference: Preference;
  readonly #place: Place;

  constructor(station: Station, preference: Preference, place: Place) {
    this.#station = station;
    this.#preference = preference;
    this.#place = place;
  }

  readonly step = $derived.by((): TourStep | null => {
    const step = this.#index === null ? undefined : STEPS[this.#index];
    return step?.page === this.#place.page ? step : null;
  });

  /** From 1. */
  get number(): number {
    return (this.#index ?? 0) + 1;
  }

  readonly isOffered = $derived.by(() => {
    const name = this.#station.session?.name;
    return name !== undefined && !this.#preference.toured.includes(name);
  });

  begin(): void {
    this.decline();
    this.#show(0);
  }

  /** Offer it no more. */
  decline(): void {
    const name = this.#station.session?.name;
    if (name !== undefined && this.isOffered) {
      this.#preference.toured = [...this.#preference.toured, name];
    }
  }

  next(): void {
    if (this.number < STEPS.length) this.#show(this.number);
    else this.end();
  }

  back(): void {
    if (this.number > 1) this.#show(this.number - 2);
  }

  end(): void {
    this.#index = null;
  }

  #show(index: number): void {
    const step = STEPS[index];
    if (!step) return;
    this.#index = index;
    this.#place.go(step.page);
  }
}
