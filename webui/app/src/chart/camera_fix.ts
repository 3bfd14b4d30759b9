import type { CameraFix } from '../api/types';
import { age } from '../text/time';
import { ellipse95 } from './ellipse';
import type { PredictedMark } from './predicted';

/** So long a fix is drawn, s; an older one says where the robot was. */
export const DRAWN_S = 30;

/** Where cameras saw a robot, with the ellipse that holds it with 95 %; never its own word. */
export function fixMark(fix: CameraFix | null, nowMs: number): PredictedMark[] {
  if (fix === null) return [];
  const ageS = Math.max(0, (nowMs - Date.parse(fix.measured_at)) / 1000);
  if (ageS > DRAWN_S) return [];
  const [north, east] = fix.ned_m;
  const [nn, ne, , ee] = fix.covariance_m2;
  const ellipse = ellipse95([nn, ne, ee]);
  return [
    {
      id: fix.robot,
      way: [],
      at: [north, east],
      ellipseM: [ellipse?.longM ?? 0, ellipse?.shortM ?? 0],
      ellipseRad: ellipse?.directionRad ?? 0,
      label: `cameras, ${age(ageS)}`,
    },
  ];
}
