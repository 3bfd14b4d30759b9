import type { DiveFacts, Series, SeriesRows } from '../../../api/types';
import { contour } from '../../../chart/contour';
import { finiteRange, ticks } from '../../../chart/slice';
import { compact, screenUnit } from '../../../text/unit';

/** What the figures of an analysis show, in the units of their axes. */

export type Range = readonly [low: number, high: number];

export interface Axis {
  title: string;
  range: Range;
  /** Seconds since 1970. */
  isTime?: boolean;
  /** Whole numbers alone mean something, such as those of dives. */
  isWhole?: boolean;
  /** Grows downwards, as depth does. */
  isDown?: boolean;
}

/** Points with a flag of OG1.0 each. */
export interface Dots {
  x: readonly number[];
  y: readonly number[];
  flag: readonly number[];
  /** Of each, 0 to `SHADES` - 1; of one colour if `null`. */
  shade: readonly number[] | null;
}

/** Lines of one look. */
export interface Stroke {
  lines: readonly (readonly (readonly [x: number, y: number])[])[];
  colour: string;
  isDashed?: boolean;
  /** Stands at the end of its longest line. */
  label?: string;
}

/** Columns between edges. */
export interface Bars {
  from: readonly number[];
  to: readonly number[];
  height: readonly number[];
}

/** What the shades of a figure mean. */
export interface ShadeScale {
  title: string;
  range: Range;
}

/** A line of the legend that is no flag. */
export interface LineKey {
  title: string;
  colour: string;
  isDashed?: boolean;
}

export interface Drawing {
  x: Axis;
  y: Axis;
  dots: Dots | null;
  strokes: readonly Stroke[];
  bars: Bars | null;
  scale: ShadeScale | null;
  keys: readonly LineKey[];
}

export const SHADES = 16;

/** Name of a shade's colour, which a theme gives its value. */
export function shadeVar(shade: number): string {
  return `var(--shade-${shade})`;
}

/** `Temperature, °C` */
export function titleOf({ title, unit, kind }: Series): string {
  const { label } = screenUnit(unit === 'degree' ? 'deg' : unit);
  return title + (kind === 'derived' ? ' (derived)' : '') + (label ? `, ${label}` : '');
}

/** Which shade a value has; the ends take what is beyond them. */
export function shadeOf(value: number, [low, high]: Range): number {
  if (high <= low) return SHADES / 2;
  const place = Math.floor(((value - low) / (high - low)) * SHADES);
  return Math.max(0, Math.min(SHADES - 1, place));
}

/** A range with some room at both ends. */
export function roomy([low, high]: Range, share = 0.04): Range {
  const room = (high - low) * share;
  return [low - room, high + room];
}

/** Depths from the surface down. */
export function depthRange(values: Iterable<number | null>): Range {
  const [, deepest] = finiteRange(values) ?? [0, 1];
  return [0, Math.max(deepest * 1.04, 0.1)];
}

/** Range of values without the rarest at both ends, so that one bad value takes no colour away. */
export function usualRange(values: readonly (number | null)[]): Range {
  const told = values
    .filter((value): value is number => value !== null && Number.isFinite(value))
    .toSorted((a, b) => a - b);
  const at = (share: number) => told[Math.round(share * (told.length - 1))] ?? 0;
  return finiteRange([at(0.01), at(0.99)]) ?? [0, 1];
}

interface Picked {
  a: number[];
  b: number[];
  row: number[];
  flag: number[];
}

/** Rows where both are told, with the graver of two flags. */
function both(
  a: readonly (number | null)[],
  b: readonly (number | null)[],
  flags: readonly (readonly (number | null)[])[],
): Picked {
  const found: Picked = { a: [], b: [], row: [], flag: [] };
  a.forEach((one, row) => {
    const other = b[row] ?? null;
    if (one === null || other === null) return;
    found.a.push(one);
    found.b.push(other);
    found.row.push(row);
    found.flag.push(Math.max(...flags.map((each) => each[row] ?? 0)));
  });
  return found;
}

const NOTHING = { strokes: [], bars: null, scale: null, keys: [] } as const;

/** Depth over time, coloured by the series. */
export function sectionOf(rows: SeriesRows): Drawing | null {
  const series = rows.series[0];
  if (!series) return null;
  const found = both(rows.depth_m, series.value, [series.flag]);
  const times = found.row.map((row) => rows.time_s[row] ?? 0);
  const range = finiteRange(times);
  if (!range) return null;
  const shown = usualRange(found.b);
  return {
    ...NOTHING,
    x: { title: 'Time, UTC', range: roomy(range, 0.01), isTime: true },
    y: { title: 'Depth, m', range: depthRange(found.a), isDown: true },
    dots: { x: times, y: found.a, flag: found.flag, shade: found.b.map((v) => shadeOf(v, shown)) },
    scale: { title: titleOf(series.series), range: shown },
  };
}

export type Halves = 'both' | 'down' | 'up';

/** The series over depth, a line for each half of a dive, coloured by the dive. */
export function profilesOf(rows: SeriesRows, halves: Halves): Drawing | null {
  const series = rows.series[0];
  if (!series) return null;
  const wanted = { both: [1, -1], down: [1], up: [-1] }[halves];
  const found = both(series.value, rows.depth_m, [series.flag]);
  const kept = found.row.map((row) => wanted.includes(rows.direction[row] ?? 0));
  const dives = found.row.filter((_, i) => kept[i]).map((row) => rows.dive[row] ?? 0);
  const span = finiteRange(dives);
  if (!span) return null;
  const range: Range = dives.every((one) => one === dives[0])
    ? [dives[0] ?? 1, dives[0] ?? 1]
    : span;
  const legs = new Map<number, [number, number][]>();
  const flagged: Dots = { x: [], y: [], flag: [], shade: null };
  const grave = { x: [] as number[], y: [] as number[], flag: [] as number[] };
  found.row.forEach((row, i) => {
    if (!kept[i]) return;
    const point: [number, number] = [found.a[i] ?? 0, found.b[i] ?? 0];
    if ((found.flag[i] ?? 0) >= 3) {
      grave.x.push(point[0]);
      grave.y.push(point[1]);
      grave.flag.push(found.flag[i] ?? 0);
      return;
    }
    const leg = rows.leg[row] ?? 0;
    legs.set(leg, [...(legs.get(leg) ?? []), point]);
  });
  const first = new Map(rows.leg.map((leg, row) => [leg, row] as const).toReversed());
  const strokes = [...legs].map(([leg, points]) => {
    const row = first.get(leg) ?? 0;
    return {
      lines: [points],
      colour: shadeVar(shadeOf(rows.dive[row] ?? 0, range)),
      isDashed: rows.direction[row] === -1,
    };
  });
  const values = found.a.filter((_, i) => kept[i]);
  return {
    ...NOTHING,
    x: { title: titleOf(series.series), range: roomy(finiteRange(values) ?? [0, 1]) },
    y: { title: 'Depth, m', range: depthRange(found.b.filter((_, i) => kept[i])), isDown: true },
    dots: { ...flagged, ...grave },
    strokes,
    scale: range[0] === range[1] ? null : { title: 'Dive', range },
    keys: [
      { title: 'down', colour: 'var(--text)' },
      { title: 'up', colour: 'var(--text)', isDashed: true },
    ].filter(({ title }) => halves === 'both' || title === halves),
  };
}

/** One series over another, coloured by depth. */
export function scatterOf(rows: SeriesRows): Drawing | null {
  const [x, y] = rows.series;
  if (!x || !y) return null;
  const found = both(x.value, y.value, [x.flag, y.flag]);
  const across = finiteRange(found.a);
  const up = finiteRange(found.b);
  if (!across || !up) return null;
  const depths = found.row.map((row) => rows.depth_m[row] ?? 0);
  const range = depthRange(depths);
  return {
    ...NOTHING,
    x: { title: titleOf(x.series), range: roomy(across) },
    y: { title: titleOf(y.series), range: roomy(up), isDown: y.series.key === 'depth' },
    dots: {
      x: found.a,
      y: found.b,
      flag: found.flag,
      shade: depths.map((depth) => shadeOf(depth, range)),
    },
    scale: { title: 'Depth, m', range },
  };
}

const DENSITIES = 8;

/** Conservative temperature over absolute salinity, with lines of equal density. */
export function tsOf(rows: SeriesRows): Drawing | null {
  const drawing = scatterOf(rows);
  if (!drawing || !rows.density) return drawing;
  const { salinity, temperature, sigma0 } = rows.density;
  const values = Float64Array.from(sigma0.flat());
  const range = finiteRange(values);
  if (!range) return drawing;
  const at = (axis: readonly number[], place: number) =>
    (axis[0] ?? 0) + (place / (axis.length - 1)) * ((axis.at(-1) ?? 1) - (axis[0] ?? 0));
  const strokes = ticks(range[0], range[1], DENSITIES).map((level) => ({
    lines: contour(values, salinity.length, temperature.length, level).map(
      ([x0, y0, x1, y1]) =>
        [
          [at(salinity, x0), at(temperature, y0)],
          [at(salinity, x1), at(temperature, y1)],
        ] as const,
    ),
    colour: 'var(--line-strong)',
    label: compact(level, 4),
  }));
  const keys = [{ title: 'potential density σ₀, kg/m³', colour: 'var(--line-strong)' }];
  const inside = (axis: readonly number[]) => [axis[0] ?? 0, axis.at(-1) ?? 1] as const;
  return {
    ...drawing,
    x: { ...drawing.x, range: inside(salinity) },
    y: { ...drawing.y, range: inside(temperature) },
    strokes,
    keys,
  };
}

/** How often which values were measured. */
export function histogramOf(rows: SeriesRows): Drawing | null {
  const series = rows.series[0];
  if (!series || series.bins.counts.length === 0) return null;
  const { edges, counts } = series.bins;
  return {
    ...NOTHING,
    x: { title: titleOf(series.series), range: roomy([edges[0] ?? 0, edges.at(-1) ?? 1], 0.02) },
    y: { title: 'Values', range: [0, Math.max(...counts) * 1.05] },
    dots: null,
    bars: { from: edges.slice(0, -1), to: edges.slice(1), height: counts },
  };
}

/** What is drawn of each dive. */
export const MEASURES = [
  { key: 'depth_m', title: 'Depth', axis: 'Greatest depth, m', isDown: true },
  { key: 'duration_s', title: 'Duration', axis: 'Duration, s', isDown: false },
  { key: 'distance_m', title: 'Distance', axis: 'Distance over ground, m', isDown: false },
  { key: 'energy_j', title: 'Energy', axis: 'Energy, J', isDown: false },
] as const;
export type Measure = (typeof MEASURES)[number]['key'];

/** A measure of every dive. */
export function divesOf(dives: readonly DiveFacts[], measure: Measure): Drawing | null {
  const { axis, isDown } = MEASURES.find(({ key }) => key === measure) ?? MEASURES[0];
  const told = dives.filter((dive) => dive[measure] !== null);
  const heights = told.map((dive) => dive[measure] ?? 0);
  if (heights.length === 0) return null;
  return {
    ...NOTHING,
    x: { title: 'Dive', range: [0.4, (dives.at(-1)?.number ?? 1) + 0.6], isWhole: true },
    y: { title: axis, range: [0, Math.max(...heights, 1e-3) * 1.05], isDown },
    dots: null,
    bars: {
      from: told.map(({ number }) => number - 0.3),
      to: told.map(({ number }) => number + 0.3),
      height: heights,
    },
  };
}
