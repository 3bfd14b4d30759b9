import type { FlownPoint, Leg, PlanPoint, Rehearsal } from '../../api/types';

/** A moment of a plan, with the pauses at the surface counted in. */
export interface ProfilePoint {
  t: number;
  depth: number;
  std: number;
}

export interface Profile {
  points: ProfilePoint[];
  /** Moments at which the robot comes up, counted as the account counts them. */
  surfacings: number[];
  duration: number;
}

/**
 * Depth and position uncertainty over planned time.
 *
 * A plan's points leave out the time at the surface before each leg that begins there; its account
 * does not. What is left over is spread over the rests before these legs.
 */
export function profileOf(
  points: readonly PlanPoint[],
  duration_s: number | null,
  legs: readonly ProfileLeg[],
): Profile {
  const last = points.at(-1)?.[0] ?? 0;
  const waiting = surfaceStarts(legs);
  const pause = waiting.length > 0 ? Math.max(0, (duration_s ?? last) - last) / waiting.length : 0;
  const surfacings = surfaceEnds(legs).map(({ t, rests }) => t + rests * pause);
  const moved: ProfilePoint[] = [];
  let paused = 0;
  points.forEach(([t, , , depth, std], i) => {
    while (waiting[0] !== undefined && (waiting[0] < t || (i === 0 && waiting[0] <= t))) {
      const start = waiting.shift() ?? 0;
      const [, , , up, sure] = points[i - 1] ?? [0, 0, 0, 0, std];
      moved.push({ t: start + paused, depth: up, std: sure });
      paused += pause;
      moved.push({ t: start + paused, depth: up, std: sure });
    }
    moved.push({ t: t + paused, depth, std });
  });
  return { points: moved, surfacings, duration: Math.max(last + paused, duration_s ?? 0) };
}

/** The same of an expected track, whose times are those of the rehearsals. */
export function expectedProfile(
  { expected, expected_times_s: times, duration_s }: Rehearsal,
  legs: readonly ProfileLeg[],
): Profile {
  const each = expected.length / Math.max(1, times.length);
  const points = times.flatMap(([begin, end], leg) =>
    expected.slice(leg * each, (leg + 1) * each).map(([, , , depth, std], i): ProfilePoint => ({
      t: begin + ((end - begin) * i) / Math.max(1, each - 1),
      depth,
      std,
    })),
  );
  const surfacings = times.flatMap(([, end], i) => (comesUp(legs[i]) ? [end] : []));
  return { points, surfacings, duration: Math.max(points.at(-1)?.t ?? 0, duration_s ?? 0) };
}

type ProfileLeg = Pick<Leg, 'start_ned' | 'end_ned' | 'duration_s'>;

/** Flight times at which the robot comes up, and before how many legs it has rested by then. */
function surfaceEnds(legs: readonly ProfileLeg[]): { t: number; rests: number }[] {
  let t = 0;
  let rests = 0;
  return legs.flatMap(({ start_ned, end_ned, duration_s }) => {
    t += duration_s;
    if (start_ned[2] <= 0) rests += 1;
    return comesUp({ start_ned, end_ned }) ? [{ t, rests }] : [];
  });
}

function comesUp(leg: Pick<Leg, 'start_ned' | 'end_ned'> | undefined): boolean {
  return leg !== undefined && leg.end_ned[2] <= 0 && leg.start_ned[2] > 0;
}

/** Flight times at which legs begin at the surface. */
function surfaceStarts(legs: readonly ProfileLeg[]): number[] {
  let t = 0;
  return legs.flatMap(({ start_ned, duration_s }) => {
    const start = t;
    t += duration_s;
    return start_ned[2] <= 0 ? [start] : [];
  });
}

/** The rehearsed flight as a profile. */
export function flownProfile(flown: readonly FlownPoint[]): ProfilePoint[] {
  return flown.map(([t, , , depth, std]) => ({ t, depth, std }));
}

/** Index of the point nearest in time. */
export function nearestPoint(points: readonly ProfilePoint[], t: number): number {
  let best = 0;
  points.forEach((point, i) => {
    if (Math.abs(point.t - t) < Math.abs((points[best]?.t ?? 0) - t)) best = i;
  });
  return best;
}

/** Bands of position uncertainty between the thresholds of fidelity, the best located first. */
export function fidelityBands(
  thresholds_m: readonly number[],
  top: number,
): { low: number; high: number; level: number }[] {
  const edges = [0, ...thresholds_m.filter((edge) => edge < top), top];
  return edges.slice(0, -1).map((low, i) => ({
    low,
    high: edges[i + 1] ?? top,
    // The best of them is the highest level; with one threshold there is no middle.
    level: Math.max(0, 2 - (thresholds_m.length === 1 ? 2 * i : i)),
  }));
}
