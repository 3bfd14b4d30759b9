import { colourTable } from '../../../chart/colour_map';
import { FLAG_MARKS, markOf } from '../../../chart/flag_mark';
import { scaleMarks, type Mark } from '../../../chart/slice';
import {
  shadeVar,
  SHADES,
  type Axis,
  type Bars,
  type Dots,
  type Range,
  type Stroke,
} from './drawing';

/** Where a drawing stands on the screen. */

export interface View {
  x: Range;
  y: Range;
}

/** The plot's own rectangle in the picture, and what it shows. */
export interface Frame extends View {
  left: number;
  top: number;
  width: number;
  height: number;
  isDown: boolean;
}

export function toX(value: number, { left, width, x }: Frame): number {
  return left + ((value - x[0]) / (x[1] - x[0])) * width;
}

export function toY(value: number, { top, height, y, isDown }: Frame): number {
  const share = (value - y[0]) / (y[1] - y[0]);
  return top + (isDown ? share : 1 - share) * height;
}

/** A path of one look. */
export interface Path {
  d: string;
  colour: string;
  kind: 'dot' | 'suspect' | 'bad';
}

/** Points inside the frame: shades first, then what is suspect, and what is bad on top. */
export function dotPaths(dots: Dots, frame: Frame): Path[] {
  const plain = new Map<number, string[]>();
  const suspect: string[] = [];
  const bad: string[] = [];
  dots.x.forEach((value, i) => {
    const y = dots.y[i] ?? NaN;
    if (!isWithin(value, frame.x) || !isWithin(y, frame.y)) return;
    const at = `M${toX(value, frame).toFixed(1)} ${toY(y, frame).toFixed(1)}`;
    const mark = markOf(dots.flag[i] ?? 0);
    if (mark === 'bad') bad.push(at + FLAG_MARKS.bad.d);
    else if (mark === 'suspect') suspect.push(at + FLAG_MARKS.suspect.d);
    else {
      const shade = dots.shade?.[i] ?? -1;
      const known = plain.get(shade);
      if (known) known.push(`${at}h0`);
      else plain.set(shade, [`${at}h0`]);
    }
  });
  const shades = [...plain].toSorted(([a], [b]) => a - b);
  const paths: Path[] = shades.map(([shade, parts]) => ({
    d: parts.join(''),
    colour: shade < 0 ? 'var(--accent)' : shadeVar(shade),
    kind: 'dot',
  }));
  if (suspect.length > 0)
    paths.push({ d: suspect.join(''), colour: 'var(--watch)', kind: 'suspect' });
  if (bad.length > 0) paths.push({ d: bad.join(''), colour: 'var(--alarm)', kind: 'bad' });
  return paths;
}

/** Lines of a stroke; what is outside is cut off by the picture. */
export function strokePath(stroke: Stroke, frame: Frame): string {
  return stroke.lines
    .map((line) =>
      line
        .map(
          ([x, y], i) =>
            `${i === 0 ? 'M' : 'L'}${toX(x, frame).toFixed(1)} ${toY(y, frame).toFixed(1)}`,
        )
        .join(''),
    )
    .join('');
}

/** Where the label of a stroke stands: the place inside that is farthest to the right. */
export function labelPlace(stroke: Stroke, frame: Frame): readonly [number, number] | null {
  let best: readonly [number, number] | null = null;
  for (const [x, y] of stroke.lines.flat()) {
    if (isWithin(x, frame.x) && isWithin(y, frame.y) && (!best || x > best[0])) best = [x, y];
  }
  return best && [toX(best[0], frame), toY(best[1], frame)];
}

export function barPath(bars: Bars, frame: Frame): string {
  const zero = toY(0, frame);
  return bars.from
    .map((from, i) => {
      const left = toX(from, frame);
      const right = toX(bars.to[i] ?? from, frame);
      const gap = right - left > 4 ? 0.5 : 0;
      const top = toY(bars.height[i] ?? 0, frame).toFixed(1);
      return `M${(left + gap).toFixed(1)} ${zero.toFixed(1)}V${top}H${(right - gap).toFixed(1)}V${zero.toFixed(1)}Z`;
    })
    .join('');
}

function isWithin(value: number, [low, high]: Range): boolean {
  return value >= low && value <= high;
}

export function marksOf(axis: Axis, range: Range, count: number): Mark[] {
  if (axis.isTime) return timeMarks(range, count);
  const marks = scaleMarks(range[0], range[1], count);
  return axis.isWhole
    ? marks
        .filter(({ at }) => Math.abs(at - Math.round(at)) < 1e-6)
        .map(({ at }) => ({ at, text: String(Math.round(at)) }))
    : marks;
}

const DAY_S = 86_400;
const STEPS_S = [
  1,
  2,
  5,
  10,
  15,
  30,
  60,
  120,
  300,
  600,
  900,
  1800,
  3600,
  7200,
  10_800,
  21_600,
  43_200,
  DAY_S,
];

/** Round times between two moments, s since 1970, UTC; from a day on their dates. */
export function timeMarks([from, to]: Range, count: number): Mark[] {
  const least = (to - from) / Math.max(1, count);
  const step =
    STEPS_S.find((each) => each >= least) ?? Math.max(1, Math.round(least / DAY_S)) * DAY_S;
  const first = Math.ceil(from / step - 1e-9);
  const last = Math.floor(to / step + 1e-9);
  return Array.from({ length: Math.max(0, last - first + 1) }, (_, i) => {
    const at = (first + i) * step;
    const iso = new Date(at * 1000).toISOString();
    const text =
      step >= DAY_S ? iso.slice(5, 10) : step >= 60 ? iso.slice(11, 16) : iso.slice(11, 19);
    return { at, text };
  });
}

/** Title of an axis; of times with the day that they begin at. */
export function axisTitle(axis: Axis, range: Range): string {
  return axis.isTime
    ? `${axis.title}, from ${new Date(range[0] * 1000).toISOString().slice(0, 10)}`
    : axis.title;
}

/** What a dragged rectangle of the picture shows; `null` for one that is too small to be meant. */
export function viewOf(
  from: readonly [number, number],
  to: readonly [number, number],
  frame: Frame,
): View | null {
  if (Math.abs(to[0] - from[0]) < 6 || Math.abs(to[1] - from[1]) < 6) return null;
  const across = [from[0], to[0]].map((px) => {
    const share = Math.max(0, Math.min(1, (px - frame.left) / frame.width));
    return frame.x[0] + share * (frame.x[1] - frame.x[0]);
  });
  const down = [from[1], to[1]].map((px) => {
    const share = Math.max(0, Math.min(1, (px - frame.top) / frame.height));
    return frame.y[0] + (frame.isDown ? share : 1 - share) * (frame.y[1] - frame.y[0]);
  });
  const ordered = ([a = 0, b = 0]: readonly number[]): Range => [Math.min(a, b), Math.max(a, b)];
  return { x: ordered(across), y: ordered(down) };
}

/** A view that is `factor` times as wide around the same middle, moved by shares of itself. */
export function movedView({ x, y }: View, factor: number, right = 0, up = 0): View {
  const part = ([low, high]: Range, by: number): Range => {
    const half = ((high - low) / 2) * factor;
    const middle = (low + high) / 2 + by * (high - low);
    return [middle - half, middle + half];
  };
  return { x: part(x, right), y: part(y, up) };
}

const NIGHT = ['86291a', 'c24c34', 'ff6a52', 'ffc4b0'];

/** Colours of the shades; of one hue at night, brighter all the way. */
export function shadeColours(isNight: boolean): string[] {
  const table = colourTable('viridis');
  return Array.from({ length: SHADES }, (_, shade) => {
    const share = (shade + 0.5) / SHADES;
    if (!isNight) {
      const at = Math.round(share * 255) * 3;
      return hex([0, 1, 2].map((channel) => table[at + channel] ?? 0));
    }
    const place = share * (NIGHT.length - 1);
    const low = Math.min(Math.floor(place), NIGHT.length - 2);
    const [from, to] = [NIGHT[low] ?? '', NIGHT[low + 1] ?? ''].map((text) =>
      [0, 2, 4].map((at) => parseInt(text.slice(at, at + 2), 16)),
    );
    return hex(
      [0, 1, 2].map((c) => (from?.[c] ?? 0) + (place - low) * ((to?.[c] ?? 0) - (from?.[c] ?? 0))),
    );
  });
}

function hex(channels: readonly number[]): string {
  return `#${channels.map((one) => Math.round(one).toString(16).padStart(2, '0')).join('')}`;
}
