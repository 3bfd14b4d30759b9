/** A channel's history for a chart: two columns, times in seconds since 1970. */
export interface Series {
  t: number[];
  v: (number | null)[];
}

/**
 * The same series with an empty value inside every gap, so that a gap is drawn as a gap.
 *
 * A gap is a step of more than `factor` times the middle step, and of at least `least` seconds.
 */
export function withGaps(series: Series, factor = 6, least = 5): Series {
  const { t, v } = series;
  if (t.length < 3) return series;
  const steps = t.slice(1).map((at, i) => at - (t[i] ?? at));
  const middle = steps.toSorted((a, b) => a - b)[Math.floor(steps.length / 2)] ?? 0;
  const limit = Math.max(least, middle * factor);
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

/** Path of a small line in a box of `width` x `height`; gaps lift the pen. */
export function sparkPath(
  series: Series,
  [from, to]: readonly [number, number],
  [top, bottom]: readonly [number, number],
  width: number,
  height: number,
): string {
  let isDown = false;
  let path = '';
  series.t.forEach((at, i) => {
    const value = series.v[i];
    if (value === null || value === undefined) {
      isDown = false;
      return;
    }
    if (at < from) return;
    const x = ((at - from) / Math.max(to - from, 1e-9)) * width;
    const y = ((value - top) / Math.max(bottom - top, 1e-9)) * height;
    path += `${isDown ? 'L' : 'M'}${x.toFixed(1)} ${y.toFixed(1)}`;
    isDown = true;
  });
  return path;
}
