import { untrack } from 'svelte';
import type { Api } from '../api/client';
import type { TrackView } from '../api/types';

/** The newest so many are asked for; the station hands out no more at once. */
const LOADED = 5000;
/** Reports that are kept; older ones fall out. */
const KEPT = 6000;

/** What a robot said of its hold on one target: loaded once, then kept current from the live stream. */
export class TrackHistory {
  /** The oldest first; replaced as a whole. */
  reports = $state.raw<readonly TrackView[]>([]);
  isLoaded = $state.raw(false);

  /** Load what the station kept of a plan. */
  async load(api: Api, robot: string, plan: string | null, signal: AbortSignal): Promise<void> {
    let loaded: readonly TrackView[] = [];
    try {
      loaded = (await api.tracking(robot, { plan, limit: LOADED }, signal)).reports;
    } catch {
      // Without history the lines begin now.
    }
    if (signal.aborted) return;
    this.reports = merged(
      loaded,
      untrack(() => this.reports),
    );
    this.isLoaded = true;
  }

  /** Take the newest report over from the live stream. */
  take(report: TrackView | null | undefined): void {
    if (!report) return;
    const known = untrack(() => this.reports);
    const next = merged(known, [report]);
    if (next !== known) this.reports = next;
  }
}

/** Reports of two sources in the order in which they were measured, each once. */
export function merged(
  known: readonly TrackView[],
  more: readonly TrackView[],
): readonly TrackView[] {
  const last = known.at(-1);
  const newer = last
    ? more.filter(({ measured_at }) => Date.parse(measured_at) > Date.parse(last.measured_at))
    : more;
  return newer.length === 0 ? known : [...known, ...newer].slice(-KEPT);
}
