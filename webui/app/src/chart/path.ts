import type { Leg, Track } from '../api/types';

/** Points along a leg, north and east; a spiral is drawn as the arc that it is. */
export function legPoints(leg: Leg): [number, number, number][] {
  const [n0, e0, d0] = leg.start_ned;
  const [n1, e1, d1] = leg.end_ned;
  if (leg.kind !== 'spiral' || leg.radius_m <= 0) {
    return [
      [n0, e0, d0],
      [n1, e1, d1],
    ];
  }
  // Turning to starboard, the centre lies to the right of the entry heading.
  const side = Math.sign(leg.turn_rad) || 1;
  const centreN = n0 - side * leg.radius_m * Math.sin(leg.heading_rad);
  const centreE = e0 + side * leg.radius_m * Math.cos(leg.heading_rad);
  const steps = Math.max(8, Math.ceil(Math.abs(leg.turn_rad) / 0.2));
  return Array.from({ length: steps + 1 }, (_, i) => {
    const share = i / steps;
    const heading = leg.heading_rad + leg.turn_rad * share;
    return [
      centreN + side * leg.radius_m * Math.sin(heading),
      centreE - side * leg.radius_m * Math.cos(heading),
      d0 + (d1 - d0) * share,
    ];
  });
}

/** A stretch of a track that looks alike: of one fidelity, or drifted at the surface. */
export interface TrackRun {
  level: number | 'drift' | null;
  points: [number, number][];
}

/** A track cut into runs that look alike; each run begins where the one before ended. */
export function fidelityRuns(
  track: Pick<Track, 'north_m' | 'east_m' | 'fidelity' | 'adrift'>,
): TrackRun[] {
  const runs: TrackRun[] = [];
  track.north_m.forEach((north, i) => {
    const point: [number, number] = [north, track.east_m[i] ?? 0];
    const level = track.adrift[i] ? 'drift' : (track.fidelity[i] ?? null);
    const last = runs.at(-1);
    if (last?.level === level) last.points.push(point);
    else {
      last?.points.push(point);
      runs.push({ level, points: [point] });
    }
  });
  return runs;
}
