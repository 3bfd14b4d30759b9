import type { NorthEast, Prediction } from '../api/types';
import { age } from '../text/time';

/** Where a robot that is not heard should be now; drawn dashed, and never as its own word. */
export interface PredictedMark {
  id: string;
  /** From where it said to be. */
  way: readonly NorthEast[];
  at: NorthEast;
  /** Half axes, the longer one first, m. */
  ellipseM: readonly [number, number];
  ellipseRad: number;
  label: string;
}

/** A prediction at a moment, between the two places of its path that are nearest in time. */
export function predictedMark(prediction: Prediction, nowMs: number): PredictedMark | null {
  const { path, said_at: saidAt } = prediction;
  const later = path.findIndex(({ at }) => Date.parse(at) >= nowMs);
  const next = path[later < 0 ? path.length - 1 : later];
  if (!next || saidAt === null) return null;
  const before = path[Math.max(0, (later < 0 ? path.length - 1 : later) - 1)] ?? next;
  const [from, to] = [Date.parse(before.at), Date.parse(next.at)];
  const share = to > from ? Math.min(1, Math.max(0, (nowMs - from) / (to - from))) : 1;
  const between = (a: number, b: number) => a + share * (b - a);
  const at: NorthEast = [
    between(before.north_m, next.north_m),
    between(before.east_m, next.east_m),
  ];
  const passed = path
    .filter((one) => Date.parse(one.at) < nowMs)
    .map(({ north_m: north, east_m: east }): NorthEast => [north, east]);
  return {
    id: prediction.robot,
    way: [...passed, at],
    at,
    ellipseM: [
      between(before.ellipse_m[0], next.ellipse_m[0]),
      between(before.ellipse_m[1], next.ellipse_m[1]),
    ],
    ellipseRad: next.ellipse_rad,
    label: `${prediction.robot} predicted; heard ${age((nowMs - Date.parse(saidAt)) / 1000)}`,
  };
}
