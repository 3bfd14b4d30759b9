import type { PlanListing } from '../../api/types';
import { Fetched } from '../../live/fetched.svelte';
import type { Station } from '../../live/station.svelte';

/** States of a plan that may still be flown to its end, those that end first at the front. */
const AHEAD = ['running', 'waiting', 'on_board', 'sent', 'draft'] as const;

/** Plans of a robot that another one can be flown after. */
export class PlansBefore {
  readonly #station: Station;
  readonly #source: Fetched<readonly PlanListing[]>;
  readonly #plan: string;

  constructor(station: Station, robot: string, plan: string) {
    this.#station = station;
    this.#plan = plan;
    this.#source = new Fetched(async () => {
      const found = await Promise.all(AHEAD.map((state) => station.api.plans(robot, state)));
      return found.flat();
    });
  }

  readonly plans = $derived.by(() =>
    (this.#source.value ?? []).filter(({ id }) => id !== this.#plan),
  );

  readonly isKnown = $derived.by(() => this.#source.value !== null);

  readonly refusal = $derived.by(() => this.#source.refusal);

  /** Any change of a plan's state is reason to ask again. */
  readonly #news = $derived.by(() =>
    Object.entries(this.#station.plans)
      .map(([id, { state = '' }]) => `${id} ${state}`)
      .join(),
  );

  /** Keep it current until the returned function is called; for effects. */
  follow(): () => void {
    void this.#news;
    return this.#source.follow();
  }
}
