import { queryString } from '../api/address';
import { rfc3339 } from '../text/time';

/** How many times as fast as life a replay may play. */
export const SPEEDS = [0.1, 0.5, 1, 2, 5, 10, 50, 100, 500, 1000] as const;

/** By which clock a moment is told: what had been measured by then, or what had been heard. */
export type ReplayClock = 'measured' | 'received';

/**
 * Where in time the pages of this tab are: now, or at a moment of the past.
 *
 * It is in the address of the page; each tab has its own, and the station keeps none.
 */
export class Cursor {
  /** Moment that is replayed, ms since 1970; `null` while the pages are live. */
  at = $state.raw<number | null>(null);
  speed = $state.raw(1);
  playing = $state.raw(false);
  /** Stretch that is played over and over, ms since 1970. */
  loop = $state.raw<readonly [from: number, to: number] | null>(null);
  clock = $state.raw<ReplayClock>('measured');
  readonly mode = $derived(this.at === null ? 'live' : 'replay');
  readonly isReplay = $derived(this.at !== null);

  constructor(search = '') {
    this.take(search);
  }

  /** Take over what the query of an address says; without a moment it is live. */
  take(search: string): void {
    // eslint-disable-next-line svelte/prefer-svelte-reactivity -- it is only read
    const query = new URLSearchParams(search);
    const at = Date.parse(query.get('at') ?? '');
    this.playing = false;
    this.at = Number.isNaN(at) ? null : at;
    this.clock = query.get('clock') === 'received' ? 'received' : 'measured';
    const speed = Number(query.get('speed') ?? 1);
    this.speed = SPEEDS.find((known) => known === speed) ?? 1;
    const [from = NaN, to = NaN] = (query.get('loop') ?? '')
      .split('/')
      .map((end) => Date.parse(end));
    this.loop = to > from ? [from, to] : null;
  }

  /** The query of an address that opens the same; empty while live. */
  search(): string {
    if (this.at === null) return '';
    const query = queryString({
      at: rfc3339(this.at),
      speed: this.speed === 1 ? null : this.speed,
      clock: this.clock === 'measured' ? null : this.clock,
      loop: this.loop?.map((end) => rfc3339(end)).join('/'),
    });
    return query.replaceAll('%3A', ':').replaceAll('%2F', '/');
  }

  /** Go to a moment, an infinite one to an end that is known; it goes on playing if it did. */
  seek(at: number, bounds: readonly [number, number] | null = null): void {
    const to = bounds === null ? at : Math.min(Math.max(at, bounds[0]), bounds[1]);
    if (Number.isFinite(to)) this.at = to;
  }

  /** Back to now. */
  goLive(): void {
    this.take('');
  }

  /** Play on by so much of a wall clock, ms; it stops at the end, or begins its loop anew. */
  advance(elapsed: number, bounds: readonly [number, number] | null): void {
    if (this.at === null || !this.playing) return;
    let next = this.at + elapsed * this.speed;
    if (this.loop) {
      const [from, to] = this.loop;
      if (next >= to || next < from) next = from;
    } else if (bounds && next >= bounds[1]) {
      next = bounds[1];
      this.playing = false;
    }
    this.at = next;
  }
}
