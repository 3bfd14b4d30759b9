import type { FlowArrow } from '../api/types';
import { fixed } from '../text/unit';

/** Where a line goes on a map: north and east, m. */
export type Line = readonly (readonly [north: number, east: number])[];

/** The longest arrow reaches this part of the way to the next one. */
const REACH = 0.9;
const HEAD = 0.3;
const HEAD_RAD = 0.45;
const ELLIPSE_POINTS = 24;

/** Metres on the map for a current of 1 m/s, so that the strongest one just does not touch. */
export function scaleOf(arrows: readonly FlowArrow[], spacingM: number): number {
  const fastest = Math.max(0, ...told(arrows).map(speedOf));
  return fastest > 0 ? (REACH * spacingM) / fastest : 0;
}

/** Where the map tells anything. */
export function told(arrows: readonly FlowArrow[]): FlowArrow[] {
  return arrows.filter(({ is_told }) => is_told);
}

export function speedOf({ velocity_ne_m_s: [north, east] }: FlowArrow): number {
  return Math.hypot(north, east);
}

/** Shaft and head of an arrow that begins at its place. */
export function arrowLines(arrow: FlowArrow, scale: number): Line[] {
  const { north_m: x, east_m: y } = arrow;
  const [north, east] = arrow.velocity_ne_m_s;
  const tip = [x + scale * north, y + scale * east] as const;
  const length = HEAD * scale * speedOf(arrow);
  const back = Math.atan2(east, north) + Math.PI;
  const wing = (side: number) =>
    [
      tip[0] + length * Math.cos(back + side * HEAD_RAD),
      tip[1] + length * Math.sin(back + side * HEAD_RAD),
    ] as const;
  return [
    [[x, y], tip],
    [wing(1), tip, wing(-1)],
  ];
}

/** Outline of an ellipse about a place, m. */
export function ellipseLine(
  north: number,
  east: number,
  [long, short]: readonly [number, number],
  directionRad: number,
): Line {
  const [cos, sin] = [Math.cos(directionRad), Math.sin(directionRad)];
  return Array.from({ length: ELLIPSE_POINTS }, (_, i) => {
    const angle = (2 * Math.PI * i) / ELLIPSE_POINTS;
    const [along, across] = [long * Math.cos(angle), short * Math.sin(angle)];
    return [north + along * cos - across * sin, east + along * sin + across * cos] as const;
  });
}

/** Speed, direction and deviation of an arrow in words; nothing is said where nothing is known. */
export function flowText(arrow: FlowArrow): string {
  const [north, east] = arrow.velocity_ne_m_s;
  const degrees = Math.round((Math.atan2(east, north) * 180) / Math.PI + 360) % 360;
  const std = Math.max(...arrow.std_ne_m_s);
  return `${fixed(100 * speedOf(arrow), 1)} cm/s to ${String(degrees).padStart(3, '0')}°, ±${fixed(100 * std, 1)} cm/s`;
}
