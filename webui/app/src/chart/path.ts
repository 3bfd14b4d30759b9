import type { Leg, Plan, Track } from '../api/types';

const RIM_STEPS = 32;

/** Points along a leg, north and east; a spiral and the rim of a stay are drawn as what they are. */
export function legPoints(leg: Leg): [number, number, number][] {
  const [n0, e0, d0] = leg.start_ned;
  const [n1, e1, d1] = leg.end_ned;
  if (leg.kind === 'keep') {
    return Array.from({ length: RIM_STEPS + 1 }, (_, i) => {
      const angle = (2 * Math.PI * i) / RIM_STEPS;
      return [n1 + leg.radius_m * Math.cos(angle), e1 + leg.radius_m * Math.sin(angle), d1];
    });
  }
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

/** What one leg of a plan becomes when it is flown: north, east and depth of its points. */
export interface ExpectedWay {
  kind: Leg['kind'];
  points: [number, number, number][];
}

/** The track that a plan’s rehearsals let expect, leg by leg; empty where only its legs are known. */
export function expectedWays(plan: Pick<Plan, 'legs' | 'rehearsal'> | null): ExpectedWay[] {
  const rows = plan?.rehearsal?.expected ?? [];
  const legs = plan?.legs ?? [];
  const each = rows.length / legs.length;
  if (rows.length === 0 || !Number.isInteger(each)) return [];
  return legs.map(({ kind }, i) => ({
    kind,
    points: rows
      .slice(i * each, (i + 1) * each)
      .map(([, north, east, down]): [number, number, number] => [north, east, down]),
  }));
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
