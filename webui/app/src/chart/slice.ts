import type { FieldMap } from '../api/types';
import { fixed, plainNumber } from '../text/unit';

/** Which axis of the box a slice is cut across. */
export type Cut = 'depth' | 'north' | 'east';

export const CUTS: readonly { key: Cut; title: string; help: string }[] = [
  { key: 'depth', title: 'Level', help: 'Seen from above, north up, at one depth.' },
  { key: 'north', title: 'West–east', help: 'A vertical wall from west to east.' },
  { key: 'east', title: 'South–north', help: 'A vertical wall from south to north.' },
];

export interface Axis {
  title: string;
  values: readonly number[];
}

/** A plane through a map: `values` row by row from the top left as seen on the screen. */
export interface Slice {
  across: Axis;
  /** First value at the top of the screen. */
  down: Axis;
  width: number;
  height: number;
  values: Float64Array;
}

/** A point of the track, or the robot, in a slice's own axes. */
export interface Spot {
  across: number;
  down: number;
  /** Fidelity level, or `null` for the robot. */
  level: number | null;
  /** Its position was corrected after the dive. */
  isSmoothed?: boolean;
}

/** Whether part of a slice lies outside the water. */
export function hasGaps(slice: Slice): boolean {
  return slice.values.some((value) => !Number.isFinite(value));
}

/** Coordinates along the axis that a cut is moved on. */
export function cutPositions(map: FieldMap, cut: Cut): readonly number[] {
  return cut === 'depth' ? map.axes.z_m : cut === 'north' ? map.axes.x_m : map.axes.y_m;
}

/**
 * Cut a plane out of a map's values, which lie with north slowest and depth fastest.
 *
 * A level has north up; a wall has depth down. Where there is no water the slice has no number.
 */
export function cutSlice(
  map: FieldMap,
  values: readonly (number | null)[],
  cut: Cut,
  index: number,
): Slice {
  const { x_m: north, y_m: east, z_m: depth } = map.axes;
  const at = (n: number, e: number, d: number): number => {
    const place = (n * east.length + e) * depth.length + d;
    return map.mask?.[place] === false ? NaN : (values[place] ?? NaN);
  };
  const northDown = north.toReversed();
  const [across, down, pick] =
    cut === 'depth'
      ? [
          { title: 'East, m', values: east },
          { title: 'North, m', values: northDown },
          (a: number, d: number) => at(north.length - 1 - d, a, index),
        ]
      : cut === 'north'
        ? [
            { title: 'East, m', values: east },
            { title: 'Depth, m', values: depth },
            (a: number, d: number) => at(index, a, d),
          ]
        : [
            { title: 'North, m', values: north },
            { title: 'Depth, m', values: depth },
            (a: number, d: number) => at(a, index, d),
          ];
  const width = across.values.length;
  const height = down.values.length;
  const result = new Float64Array(width * height);
  for (let row = 0; row < height; row++) {
    for (let column = 0; column < width; column++) {
      result[row * width + column] = pick(column, row);
    }
  }
  return { across, down, width, height, values: result };
}

/** Least and greatest finite value; a range of one value is widened so that it can be drawn. */
export function finiteRange(values: Iterable<number | null>): [number, number] | null {
  let low = Infinity;
  let high = -Infinity;
  for (const value of values) {
    if (value === null || !Number.isFinite(value)) continue;
    if (value < low) low = value;
    if (value > high) high = value;
  }
  if (low > high) return null;
  return low === high ? [low - 0.5, high + 0.5] : [low, high];
}

/**
 * Values of a map in another scale than they come in.
 *
 * @param floor Least value that a logarithm is taken of.
 */
export function rescaled(
  values: readonly (number | null)[],
  from: 'linear' | 'log',
  to: 'linear' | 'log',
  floor: number,
): readonly (number | null)[] {
  if (from === to) return values;
  const change = from === 'log' ? Math.exp : (value: number) => Math.log(Math.max(value, floor));
  return values.map((value) => (value === null ? null : change(value)));
}

/** Outer edges of the cells whose centres are given. */
export function extent(values: readonly number[]): [number, number] {
  const first = values[0] ?? 0;
  const last = values.at(-1) ?? 1;
  const half = values.length > 1 ? (last - first) / (values.length - 1) / 2 : 0.5;
  return [first - half, last + half];
}

/** Index of the value nearest to `wanted`. */
export function nearestIndex(values: readonly number[], wanted: number): number {
  let best = 0;
  values.forEach((value, index) => {
    if (Math.abs(value - wanted) < Math.abs((values[best] ?? 0) - wanted)) best = index;
  });
  return best;
}

/** A tick of a scale: where it stands and what it says. */
export interface Mark {
  at: number;
  text: string;
}

/** Ticks at round numbers; all with the decimals that their step needs. */
export function scaleMarks(low: number, high: number, count: number): Mark[] {
  const values = ticks(low, high, count);
  const step = (values[1] ?? high) - (values[0] ?? low);
  const decimals = step > 0 ? Math.max(0, Math.ceil(-Math.log10(step) - 1e-9)) : 0;
  return values.map((at) => ({ at, text: fixed(at, decimals) }));
}

/** The same for a scale of natural logarithms: round numbers of the value itself. */
export function logMarks(low: number, high: number, count: number): Mark[] {
  const decades = (high - low) / Math.LN10;
  if (decades < 1) {
    const plain = scaleMarks(Math.exp(low), Math.exp(high), count);
    return plain.filter(({ at }) => at > 0).map(({ at, text }) => ({ at: Math.log(at), text }));
  }
  const first = Math.floor(low / Math.LN10);
  const last = Math.ceil(high / Math.LN10);
  const factors = decades > count / 2 ? [1] : decades > count / 3 ? [1, 3] : [1, 2, 5];
  const values: number[] = [];
  for (let power = first; power <= last; power++) {
    values.push(...factors.map((factor) => factor * 10 ** power));
  }
  return values
    .map((value) => ({ at: Math.log(value), text: plainNumber(value) }))
    .filter(({ at }) => at >= low && at <= high);
}

/** Round numbers between two bounds, about `count` of them. */
export function ticks(low: number, high: number, count: number): number[] {
  if (!(high > low)) return [low];
  const rough = (high - low) / Math.max(1, count);
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = ([1, 2, 5, 10].find((s) => s * power >= rough) ?? 10) * power;
  const first = Math.ceil(low / step - 1e-9);
  const last = Math.floor(high / step + 1e-9);
  return Array.from({ length: last - first + 1 }, (_, i) => (first + i) * step);
}
