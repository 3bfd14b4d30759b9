import { untrack } from 'svelte';
import type { Api } from '../api/client';
import type { TargetReport } from '../api/types';
import { Fetched } from './fetched.svelte';

/** The newest so many are asked for; the station hands out no more at once. */
const LOADED = 5000;
/** Reports that are kept; older ones fall out. */
const KEPT = 6000;
const FILL_REST_MS = 5000;

/**
 * What a robot said of its hold on one target: what the station kept, then what the live stream
 * tells. The stream tells the newest alone, so what it passed over is asked for when it went on.
 */
export class TrackHistory {
  /** The oldest first; replaced as a whole. */
  reports = $state.raw<readonly TargetReport[]>([]);
  /** Whether the station has said what it kept. */
  isKnown = $state.raw(false);
  #kept: readonly TargetReport[] = [];
  readonly #filling: Fetched<void>;

  /** @param plan Whose reports; `null` for what the robot follows now. */
  constructor(api: Api, robot: string, plan: string | null) {
    this.#filling = new Fetched(() => this.#fill(api, robot, plan), FILL_REST_MS);
  }

  /** Ask for what the stream passed over; for effects that read what it told last. */
  follow(): () => void {
    return this.#filling.follow();
  }

  /** Take the newest report over from the live stream. */
  take(report: TargetReport | null | undefined): void {
    if (!report) return;
    this.#show([...untrack(() => this.reports), report]);
  }

  async #fill(api: Api, robot: string, plan: string | null): Promise<void> {
    const after = this.#kept.at(-1)?.measured_at ?? null;
    const { reports } = await api.tracking(robot, { plan, after, limit: LOADED });
    this.isKnown = true;
    if (reports.length === 0) return;
    this.#kept = merged(this.#kept, reports).slice(-KEPT);
    this.#show(untrack(() => this.reports));
  }

  #show(live: readonly TargetReport[]): void {
    this.reports = merged(this.#kept, live).slice(-KEPT);
  }
}

/** Reports in the order in which they were measured: `more` only where it is newer than `known`. */
export function merged(
  known: readonly TargetReport[],
  more: readonly TargetReport[],
): readonly TargetReport[] {
  const result = [...known];
  let last = timeOf(result.at(-1));
  for (const report of more) {
    if (timeOf(report) <= last) continue;
    result.push(report);
    last = timeOf(report);
  }
  return result;
}

function timeOf(report: TargetReport | undefined): number {
  return report ? Date.parse(report.measured_at) : -Infinity;
}
