import { describe, expect, test } from 'vitest';
import type { DiveFacts, Series, SeriesRows } from '../../../api/types';
import {
  divesOf,
  histogramOf,
  profilesOf,
  scatterOf,
  sectionOf,
  shadeOf,
  titleOf,
  tsOf,
  usualRange,
} from './drawing';
import { divesLine, histogramLine, scatterLine, sectionLine, spanOf } from './one_liner';
import {
  dotPaths,
  marksOf,
  movedView,
  shadeColours,
  timeMarks,
  toX,
  toY,
  viewOf,
  type Frame,
} from './plot';
import { csvText, withColours } from './save';

const TEMPERATURE: Series = {
  key: 'temperature',
  title: 'Temperature',
  unit: 'degC',
  kind: 'sampled',
  variable: 'TEMP',
  decimals: 2,
};
const CHLOROPHYLL: Series = {
  ...TEMPERATURE,
  key: 'chlorophyll',
  title: 'Chlorophyll',
  unit: 'ug/L',
  variable: 'CHLA',
};
const STATISTICS = {
  count: 4, mean: 1, std: 1, median: 1, low_5: 1, high_95: 1, least: 1, greatest: 1,
}; // prettier-ignore

/** Two dives of two rows each, and one row at the surface. */
function rows(more: Partial<SeriesRows> = {}): SeriesRows {
  return {
    total: 5,
    decimated: false,
    is_checked: true,
    time_s: [0, 10, 20, 30, 40],
    dive: [1, 1, 0, 2, 2],
    leg: [1, 2, 0, 3, 4],
    direction: [1, -1, 0, 1, -1],
    depth_m: [5, 4, 0, 6, null],
    series: [
      {
        series: TEMPERATURE,
        value: [18, 17, 20, 16, 15],
        flag: [1, 3, 1, 4, 1],
        interpolated: 0,
        statistics: STATISTICS,
        bins: { edges: [15, 17, 19, 21], counts: [2, 2, 1] },
      },
      {
        series: CHLOROPHYLL,
        value: [1, null, 2, 3, 4],
        flag: [1, null, 1, 1, 3],
        interpolated: 2,
        statistics: STATISTICS,
        bins: { edges: [], counts: [] },
      },
    ],
    density: null,
    ...more,
  };
}

const FRAME: Frame = {
  left: 10,
  top: 20,
  width: 100,
  height: 50,
  x: [0, 10],
  y: [0, 5],
  isDown: true,
};

describe('a figure', () => {
  test('of a section has depth down and leaves out what has no depth', () => {
    const drawing = sectionOf(rows());
    expect(drawing?.dots?.y).toEqual([5, 4, 0, 6]);
    expect(drawing?.dots?.flag).toEqual([1, 3, 1, 4]);
    expect(drawing?.y.isDown).toBe(true);
    expect(drawing?.y.range[0]).toBe(0);
    expect(drawing?.scale?.title).toBe('Temperature, °C');
  });

  test('of profiles has a line for each half, dashed on the way up', () => {
    const drawing = profilesOf(rows(), 'both');
    expect(drawing?.strokes.map(({ isDashed }) => isDashed)).toEqual([false]);
    expect(drawing?.dots?.flag).toEqual([3, 4]);
    expect(profilesOf(rows(), 'up')?.strokes).toEqual([]);
    expect(profilesOf(rows({ direction: [0, 0, 0, 0, 0] }), 'both')).toBeNull();
  });

  test('of two channels has the graver flag of both', () => {
    const drawing = scatterOf(rows());
    expect(drawing?.dots?.x).toEqual([18, 20, 16, 15]);
    expect(drawing?.dots?.flag).toEqual([1, 1, 4, 3]);
    expect(drawing?.y.title).toBe('Chlorophyll, µg/L');
  });

  test('of a T-S diagram has lines of equal density with their value', () => {
    const density = { salinity: [34, 36], temperature: [5, 25], sigma0: [[26, 28], [22, 24]] }; // prettier-ignore
    const drawing = tsOf(rows({ density }));
    expect(drawing?.strokes.map(({ label }) => label)).toContain('25.00');
    expect(drawing?.x.range).toEqual([34, 36]);
    const [x, y] = drawing?.strokes.find(({ label }) => label === '25.00')?.lines[0]?.[0] ?? [];
    expect(26 - 0.2 * ((y ?? 0) - 5) + ((x ?? 0) - 34)).toBeCloseTo(25);
  });

  test('of a histogram begins at nothing; without values there is none', () => {
    expect(histogramOf(rows())?.bars?.height).toEqual([2, 2, 1]);
    expect(histogramOf(rows())?.y.range[0]).toBe(0);
    const [, empty] = rows().series;
    expect(empty && histogramOf(rows({ series: [empty] }))).toBeNull();
  });

  test('of dives leaves out what a robot does not tell', () => {
    const dive = {
      number: 1, begin_at: '2026-06-03T07:00:00Z', end_at: '2026-06-03T07:10:00Z',
      duration_s: 600, depth_m: 30, distance_m: null, energy_j: null, legs: 2, samples: 9,
    } satisfies DiveFacts; // prettier-ignore
    expect(divesOf([dive], 'depth_m')?.bars?.height).toEqual([30]);
    expect(divesOf([dive], 'energy_j')).toBeNull();
    const later = { ...dive, number: 2, begin_at: '2026-06-03T08:00:00Z', end_at: '2026-06-03T08:10:00Z' }; // prettier-ignore
    expect(spanOf([dive, later], '2')?.[0]).toBe('2026-06-03T08:00:00.000');
    expect(spanOf([dive, later], '1-2')?.[1]).toBe('2026-06-03T08:10:00.000');
    expect(spanOf([dive, later], '')).toBeNull();
  });

  test('gives no colour away to one bad value', () => {
    const values = [...Array.from({ length: 300 }, (_, i) => i / 100), 999];
    expect(usualRange(values)[1]).toBeLessThan(3.1);
    expect(shadeOf(999, [0, 3])).toBe(15);
    expect(shadeOf(-1, [0, 3])).toBe(0);
    expect(titleOf({ ...TEMPERATURE, unit: 'degree', title: 'Pitch' })).toBe('Pitch, °');
  });
});

describe('a place in a figure', () => {
  test('of a depth is below the surface', () => {
    expect([toX(5, FRAME), toY(0, FRAME), toY(5, FRAME)]).toEqual([60, 20, 70]);
    expect(toY(0, { ...FRAME, isDown: false })).toBe(70);
  });

  test('has a shape of its own where the value is suspect or bad', () => {
    const dots = { x: [1, 2, 3, 99], y: [1, 1, 1, 1], flag: [1, 3, 4, 1], shade: [0, 0, 0, 0] };
    const paths = dotPaths(dots, FRAME);
    expect(paths.map(({ kind }) => kind)).toEqual(['dot', 'suspect', 'bad']);
    expect(paths[0]?.d).toBe('M20.0 30.0h0');
  });

  test('is seen larger after a rectangle is dragged over it, in any direction', () => {
    expect(viewOf([60, 70], [10, 45], FRAME)).toEqual({ x: [0, 5], y: [2.5, 5] });
    expect(viewOf([60, 70], [62, 70], FRAME)).toBeNull();
    expect(movedView({ x: [0, 10], y: [0, 4] }, 0.5, 0.5)).toEqual({ x: [7.5, 12.5], y: [1, 3] });
  });

  test('has round marks, of times and of whole numbers', () => {
    const noon = Date.parse('2026-06-03T11:58:00Z') / 1000;
    expect(timeMarks([noon, noon + 1200], 4).map(({ text }) => text)).toEqual(['12:00', '12:05', '12:10', '12:15']); // prettier-ignore
    expect(timeMarks([noon, noon + 4 * 86_400], 4).map(({ text }) => text)[0]).toBe('06-04');
    const whole = marksOf({ title: 'Dive', range: [0, 3], isWhole: true }, [0.4, 3.6], 9);
    expect(whole.map(({ text }) => text)).toEqual(['1', '2', '3']);
  });

  test('grows brighter with the value, by night in one hue', () => {
    const night = shadeColours(true).map((hex) => [1, 3, 5].map((i) => parseInt(hex.slice(i, i + 2), 16))); // prettier-ignore
    expect(night.every(([red = 0, green = 0, blue = 0]) => red > green && green >= blue)).toBe(
      true,
    );
    expect(night.every(([, green = 0], i) => i === 0 || green >= (night[i - 1]?.[1] ?? 0))).toBe(
      true,
    );
  });
});

describe('what is taken away', () => {
  test('knows its colours where no theme is', () => {
    expect(withColours('fill="var(--text)" x="var(--no)"', { '--text': '#111' })).toBe(
      'fill="#111" x="var(--no)"',
    );
  });

  test('is a table with remarks, in which nothing stands for what nobody knows', () => {
    expect(csvText(['SIMULATION'], ['a', 'b, m'], [[1, null]])).toBe(
      '# SIMULATION\na,"b, m"\n1,\n',
    );
  });

  test('is one line of Python with the names of the file', () => {
    const chosen = { file: 'a_R.nc', flagMax: 3, span: null };
    expect(sectionLine(TEMPERATURE, chosen)).toBe(
      'import xarray as xr; ds = xr.open_dataset("a_R.nc"); ds = ds.where((ds.TEMP_QC <= 3)); ' +
        'ds.plot.scatter(x="TIME", y="DEPTH", hue="TEMP").axes.invert_yaxis()',
    );
    expect(histogramLine(CHLOROPHYLL, { ...chosen, flagMax: 4 })).toBe(
      'import xarray as xr; ds = xr.open_dataset("a_R.nc"); ds.CHLA.plot.hist(bins=40)',
    );
    expect(scatterLine(TEMPERATURE, CHLOROPHYLL, true, chosen)).toContain('interpolate_na("TIME"');
    expect(divesLine('energy_j', chosen)).toBe('');
  });
});
