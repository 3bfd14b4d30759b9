/** A channel's history for a chart: two columns, times in seconds since 1970. */
export interface Series {
  t: number[];
  v: (number | null)[];
}

/** A gap is a step of more than this many times the middle one, */
const GAP_STEPS = 6;
/** of at least this, s, */
const LEAST_GAP_S = 5;
/** and any step of more than this, s: a robot dives and comes up again within a few minutes. */
const SURE_GAP_S = 60;

/**
 * The same series with an empty value inside every gap, so that a gap is drawn as a gap.
 *
 * Of more than `asked` points a history keeps the least and the greatest of `asked / 2` equal
 * intervals, so that what has no gap may have steps of two intervals.
 */
export function withGaps(series: Series, asked = Infinity): Series {
  const { t, v } = series;
  const steps = t.slice(1).map((at, i) => at - (t[i] ?? at));
  const middle = steps.toSorted((a, b) => a - b)[Math.floor(steps.length / 2)] ?? 0;
  const thinned = (4 * ((t.at(-1) ?? 0) - (t[0] ?? 0))) / asked;
  const limit = Math.min(Math.max(LEAST_GAP_S, middle * GAP_STEPS), Math.max(SURE_GAP_S, thinned));
  const result: Series = { t: [], v: [] };
  t.forEach((at, i) => {
    const before = t[i - 1];
    if (before !== undefined && at - before > limit) {
      result.t.push((before + at) / 2);
      result.v.push(null);
    }
    result.t.push(at);
    result.v.push(v[i] ?? null);
  });
  return result;
}

/** What a series with its gaps says of them: how many, and from when to when the longest lasted. */
export function longestGap({ t, v }: Series): { count: number; from: number; to: number } | null {
  const gaps = v.flatMap((value, i) => {
    const [from, to] = [t[i - 1], t[i + 1]];
    return value === null && from !== undefined && to !== undefined ? [{ from, to }] : [];
  });
  const longest = gaps.toSorted((a, b) => b.to - b.from - (a.to - a.from))[0];
  return longest ? { count: gaps.length, ...longest } : null;
}

/** Where the last value is that there is; -1 where there is none. */
export function lastIndex(values: ArrayLike<number | null | undefined> | undefined): number {
  for (let i = (values?.length ?? 0) - 1; i >= 0; i--) {
    if (typeof values?.[i] === 'number') return i;
  }
  return -1;
}

/** Where the last value is at or before a moment; -1 where there is none. */
export function lastIndexUntil(
  t: ArrayLike<number>,
  values: ArrayLike<number | null | undefined> | undefined,
  at: number,
): number {
  for (let i = t.length - 1; i >= 0; i--) {
    if ((t[i] ?? Infinity) <= at && typeof values?.[i] === 'number') return i;
  }
  return -1;
}

/**
 * Where a value has no neighbour that a line could lead to.
 *
 * `null` ends a line; `undefined`, where another column of the same chart has a value, does not.
 */
export function aloneAt(values: ArrayLike<number | null | undefined>): number[] {
  const result: number[] = [];
  let last: number | null = null;
  let isJoined = false;
  const end = () => {
    if (last !== null && !isJoined) result.push(last);
    last = null;
    isJoined = false;
  };
  for (let i = 0; i < values.length; i++) {
    const value = values[i];
    if (value === undefined) continue;
    if (value === null) {
      end();
      continue;
    }
    isJoined = last !== null;
    last = i;
  }
  end();
  return result;
}

/** Add a value at the end; values closer than `spacing` seconds to the last are left out. */
export function append(series: Series, at: number, value: number, spacing: number): boolean {
  const last = series.t.at(-1);
  if (last !== undefined && at - last < spacing) return false;
  series.t.push(at);
  series.v.push(value);
  return true;
}

/** Drop what is older than `from`. */
export function trim(series: Series, from: number): void {
  const first = series.t.findIndex((at) => at >= from);
  if (first <= 0) return;
  series.t.splice(0, first);
  series.v.splice(0, first);
}

/** Bounds across and down, and the box of `width` x `height` that they fill. */
export interface SparkFrame {
  across: readonly [number, number];
  down: readonly [number, number];
  width: number;
  height: number;
}

function place(at: number, value: number, { across, down, width, height }: SparkFrame): string {
  const x = ((at - across[0]) / Math.max(across[1] - across[0], 1e-9)) * width;
  const y = ((value - down[0]) / Math.max(down[1] - down[0], 1e-9)) * height;
  return `${x.toFixed(1)} ${y.toFixed(1)}`;
}

/** Path of a small line; gaps lift the pen. */
export function sparkPath(series: Series, frame: SparkFrame): string {
  let isDown = false;
  let path = '';
  series.t.forEach((at, i) => {
    const value = series.v[i];
    if (value === null || value === undefined) {
      isDown = false;
      return;
    }
    if (at < frame.across[0]) return;
    path += `${isDown ? 'L' : 'M'}${place(at, value, frame)}`;
    isDown = true;
  });
  return path;
}

/** Path of the values that no line leads to, for a pen with a round tip. */
export function sparkDots({ t, v }: Series, frame: SparkFrame): string {
  return aloneAt(v)
    .filter((i) => (t[i] ?? -Infinity) >= frame.across[0])
    .map((i) => `M${place(t[i] ?? 0, v[i] ?? 0, frame)}h0`)
    .join('');
}
