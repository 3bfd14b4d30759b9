import type { Api } from '../api/client';
import type { Hold, Lease, StationEvent } from '../api/types';
import { clockTime } from '../text/time';
import { Fetched } from './fetched.svelte';

/** A lease as it was told, and when that was, so that its ages count on by the local clock. */
export interface ToldLease extends Lease {
  /** Local `performance.now()` of the answer; ages are the station's, this only counts on. */
  receivedAt: number;
}

/** Who is in charge of which robot, and whether automation is held; read anew as they change. */
export class Leases {
  readonly #leases: Fetched<readonly ToldLease[]>;
  readonly #hold: Fetched<Hold>;
  readonly #isTold: () => boolean;

  /** `isTold` says whether the station tells it at all: who looks by a read-only link is not. */
  constructor(api: Api, isTold: () => boolean) {
    this.#isTold = isTold;
    this.#leases = new Fetched(async () => {
      const leases = await api.lease.leases();
      const receivedAt = performance.now();
      return leases.map((lease) => ({ ...lease, receivedAt }));
    }, 100);
    this.#hold = new Fetched(() => api.lease.automation(), 100);
  }

  readonly all = $derived.by((): readonly ToldLease[] => this.#leases.value ?? []);
  readonly mine = $derived.by(() => this.all.filter(({ is_mine }) => is_mine));
  /** Robots of mine that somebody else asks for. */
  readonly asked = $derived.by(() => this.mine.filter(({ request }) => request !== null));
  readonly hold = $derived.by((): Hold | null => this.#hold.value);

  of(robot: string | null): ToldLease | null {
    return this.all.find((lease) => lease.robot === robot) ?? null;
  }

  /** Follow both until the returned function is called. */
  follow(): () => void {
    if (!this.#isTold()) return () => {};
    const ends = [this.#leases.follow(), this.#hold.follow()];
    return () => ends.forEach((end) => end());
  }

  /** Read again what the live stream says has changed. */
  take(changed: Readonly<Record<string, number>>): void {
    if (!this.#isTold()) return;
    if ('leases' in changed) this.#leases.follow();
    if ('automation' in changed) this.#hold.follow();
  }

  /** Do something with a lease, and read them again at once. */
  readonly load = (): Promise<void> => this.#leases.load();
}

/** Seconds for which nothing was seen of who is in charge, as they count on now. */
export function silentNow(lease: ToldLease, localNow: number): number {
  if (lease.silent_s === 0) return 0;
  return lease.silent_s + Math.max(0, localNow - lease.receivedAt) / 1000;
}

/** `ann is in charge, silent for 4 min`: for the header and the cards. */
export function chargeText(lease: ToldLease | null, localNow: number): string {
  if (lease === null) return '';
  if (lease.state === 'free') return 'Nobody is in charge';
  if (lease.is_mine) return 'You are in charge';
  const who = lease.holder_kind === 'script' ? `script ${lease.holder}` : lease.holder;
  const silent = silentNow(lease, localNow);
  return silent < 60 ? `${who} is in charge` : `${who} is in charge, silent for ${minutes(silent)}`;
}

/** Whether a person may request it: nobody has, or another ground station, which gives way. */
export function isRequestable({ request }: Pick<ToldLease, 'request'>): boolean {
  return request === null || request.ends_in_s !== null;
}

/** What becomes of a request that nobody answers; empty without one. */
export function unansweredText(lease: ToldLease, localNow: number): string {
  const { granted_in_s = null, ends_in_s = null } = lease.request ?? {};
  const passed = Math.max(0, localNow - lease.receivedAt) / 1000;
  if (granted_in_s !== null)
    return `Granted by itself in ${minutes(Math.max(0, granted_in_s - passed))} without an answer.`;
  if (ends_in_s !== null)
    return `Refused by itself in ${Math.max(0, Math.round(ends_in_s - passed))} s without an answer.`;
  return '';
}

export function minutes(seconds: number): string {
  const whole = Math.floor(seconds / 60);
  return whole < 1
    ? 'less than a minute'
    : whole < 120
      ? `${whole} min`
      : `${Math.floor(whole / 60)} h`;
}

/** Who refused a person's request for a robot, while nothing else was said of its lease since. */
export function refusedText(
  events: readonly Pick<StationEvent, 'kind' | 'robot' | 'text' | 'at'>[],
  robot: string,
  name: string,
): string {
  const last = events.findLast(
    (event) =>
      event.robot === robot &&
      event.kind.startsWith('lease.') &&
      !event.kind.startsWith('lease.script'),
  );
  if (last?.kind !== 'lease.refused' || !last.text.includes(` refused ${name} `)) return '';
  return `${clockTime(last.at)} ${last.text}`;
}
