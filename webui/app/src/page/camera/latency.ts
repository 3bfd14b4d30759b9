import type { LatencyCheck } from '../../api/types';

/** The station's clock as one answer told it, ms since 1970 at `performance.now()` of zero. */
export function zeroOf(now: string, askedMs: number, answeredMs: number): number {
  return Date.parse(now) - (askedMs + answeredMs) / 2;
}

/** Id of the tag that is to be shown at a moment of the station's clock, ms; `null` for none. */
export function shownTag(check: LatencyCheck, stationMs: number): number | null {
  if (check.begun_at === null) return null;
  const since = stationMs - Date.parse(check.begun_at);
  if (since < 0) return null;
  return check.first_id + (Math.floor(since / (1000 * check.step_s)) % check.count);
}

/** All ids that it shows. */
export function idsOf(check: LatencyCheck): number[] {
  return Array.from({ length: check.count }, (_, i) => check.first_id + i);
}
