/** What a robot said of the current, as far as it carries a position off. */
export interface Carrying {
  north_m_s: number;
  east_m_s: number;
  std_m_s: number;
  doubt: number;
}

/** A stated uncertainty is worth a word once it has grown by this factor. */
const CLEARLY = 1.5;

/**
 * How far off a robot may be by now of where it said it was, m; predicted, and null where the age
 * makes it hardly more than it stated, or where the robot told nothing of the current.
 *
 * A steady current that is not known carries it away in proportion to the age; one that is drifting
 * idle goes with the believed current too. The random walk of dead reckoning is left out: over an
 * age at which this is shown it is a small part.
 */
export function offByNow(
  stdM: number,
  current: Carrying | null | undefined,
  ageS: number,
  isIdle: boolean,
): number | null {
  if (!current || !(ageS > 0)) return null;
  const unknown = current.std_m_s * Math.max(1, current.doubt) * ageS;
  const carried = isIdle ? Math.hypot(current.north_m_s, current.east_m_s) * ageS : 0;
  const now = Math.hypot(stdM, unknown) + carried;
  return now > CLEARLY * stdM ? now : null;
}
