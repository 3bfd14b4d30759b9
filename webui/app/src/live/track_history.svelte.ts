import { untrack } from 'svelte';
import type { Api } from '../api/client';
import type { TargetReport } from '../api/types';

/** The newest so many are asked for; the station hands out no more at once. */
const LOADED = 5000;
/** Reports that are kept; older ones fall out. */
const KEPT = 6000;
const FILL_EVERY_MS = 5000;

/**
 * What a robot said of its hold on one target: what the station kept, then what the live stream
 * tells. The stream tells the newest alone, so what it passed over is asked for now and then.
 */
export class TrackHistory {
  /** The oldest first; replaced as a whole. */
  reports = $state.raw<readonly TargetReport[]>([]);
  #kept: readonly TargetReport[] = [];

  /** Ask for a plan's reports again and again, until the returned function is called. */
  follow(api: Api, robot: string, plan: string | null): () => void {
    const controller = new AbortController();
    const fill = () => void this.#fill(api, robot, plan, controller.signal);
    fill();
    const timer = setInterval(fill, FILL_EVERY_MS);
    return () => {
      controller.abort();
      clearInterval(timer);
    };
  }

  /** Take the newest report over from the live stream. */
  take(report: TargetReport | null | undefined): void {
    if (!report) return;
    this.#show([...untrack(() => this.reports), report]);
  }

  async #fill(api: Api, robot: string, plan: string | null, signal: AbortSignal): Promise<void> {
    const after = this.#kept.at(-1)?.measured_at ?? null;
    try {
      const { reports } = await api.tracking(robot, { plan, after, limit: LOADED }, signal);
      if (signal.aborted || reports.length === 0) return;
      this.#kept = merged(this.#kept, reports).slice(-KEPT);
      this.#show(untrack(() => this.reports));
    } catch {
      // The next round asks again; until then the lines go on from what came live.
    }
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
