import type { TargetReport } from '../../api/types';

/** Whether a robot follows its target now with nothing that keeps it observable. */
export function isTeachingNow(
  track: Pick<TargetReport, 'phase' | 'is_barrier_on'> | null | undefined,
): boolean {
  return !!track && !track.is_barrier_on && track.phase !== 'ended';
}
