import type { FlownPoint, PlanPoint } from '../../api/types';

/** A moment of a plan, with the pauses at the surface counted in. */
export interface ProfilePoint {
  t: number;
  depth: number;
  std: number;
}

export interface Profile {
  points: ProfilePoint[];
  /** Moments at which the robot comes up. */
  surfacings: number[];
  duration: number;
}

/** Shallower than this share of the plan's greatest depth is the surface. */
const SURFACE_SHARE = 0.05;

/**
 * Depth and position uncertainty over planned time.
 *
 * A plan's points leave out the time that each surfacing takes; its account does not. What is left
 * over is spread over the surfacings.
 */
export function profileOf(points: readonly PlanPoint[], duration_s: number | null): Profile {
  const deepest = Math.max(0, ...points.map(([, , , down]) => down));
  const isUp = (down: number) => down <= SURFACE_SHARE * deepest;
  const comesUp = points.map(
    ([, , , down], i) => isUp(down) && i > 0 && !isUp(points[i - 1]?.[3] ?? 0),
  );
  const last = points.at(-1)?.[0] ?? 0;
  const count = comesUp.filter(Boolean).length;
  const pause = count > 0 ? Math.max(0, (duration_s ?? last) - last) / count : 0;
  const surfacings: number[] = [];
  const moved: ProfilePoint[] = [];
  let paused = 0;
  points.forEach(([t, , , depth, std], i) => {
    moved.push({ t: t + paused, depth, std });
    if (!comesUp[i]) return;
    surfacings.push(t + paused);
    paused += pause;
    if (pause > 0) moved.push({ t: t + paused, depth, std });
  });
  return { points: moved, surfacings, duration: Math.max(last + paused, duration_s ?? 0) };
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
