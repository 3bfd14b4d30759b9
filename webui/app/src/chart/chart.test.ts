import { describe, expect, test } from 'vitest';
import type uPlot from 'uplot';
import type { FieldMap, Leg } from '../api/types';
import { colourTable, tableIndex } from './colour_map';
import { flagColumns } from './flag_mark';
import { chartOptions, padded } from './line_chart';
import { fidelityRuns, legPoints } from './path';
import {
  aloneAt,
  append,
  lastIndex,
  longestGap,
  sparkDots,
  sparkPath,
  trim,
  withGaps,
} from './series';
import {
  cutPositions,
  cutSlice,
  finiteRange,
  logMarks,
  rescaled,
  scaleMarks,
  ticks,
} from './slice';

const REST = {
  value_unit: '', site: '', origin_latitude_deg: 0, origin_longitude_deg: 0, shape: [], order: '',
  mask: null, smoothed_samples: 0, models: [], config_version: null, threshold: null, simulation: true,
  carriage: 'still' as const, water_moved: '',
  updated_at: null, scores: null,
}; // prettier-ignore

/** A map whose value at (north i, east j, depth k) is 100 i + 10 j + k. */
function countingMap(): FieldMap {
  const axes = { x_m: [0, 1, 2], y_m: [0, 1], z_m: [0, 5, 10, 15] };
  const mean = axes.x_m.flatMap((_, i) =>
    axes.y_m.flatMap((_, j) => axes.z_m.map((_, k) => 100 * i + 10 * j + k)),
  );
  return {
    robot: 'mini-1',
    variable: 'chlorophyll',
    title: 'Chlorophyll',
    unit: 'ug/L',
    scale: 'linear',
    model: 'single',
    colour_map: 'viridis',
    is_derived: false,
    axes,
    mean,
    std: mean,
    samples: { total: 0, per_fidelity: [] },
    ...REST,
  };
}

describe('a slice', () => {
  test('of one depth has north up and east to the right', () => {
    const map = countingMap();
    const slice = cutSlice(map, map.mean, 'depth', 2);
    expect([slice.width, slice.height]).toEqual([2, 3]);
    expect([...slice.values]).toEqual([202, 212, 102, 112, 2, 12]);
    expect(slice.down.values).toEqual([2, 1, 0]);
  });

  test('that is a wall has depth down', () => {
    const map = countingMap();
    const north = cutSlice(map, map.mean, 'north', 1);
    expect([...north.values]).toEqual([100, 110, 101, 111, 102, 112, 103, 113]);
    const east = cutSlice(map, map.mean, 'east', 1);
    expect([...east.values].slice(0, 3)).toEqual([10, 110, 210]);
    expect(cutPositions(map, 'east')).toEqual([0, 1]);
  });

  test('of unknown values has holes, not zeros', () => {
    const map = countingMap();
    const slice = cutSlice(map, [], 'depth', 0);
    expect([...slice.values].every(Number.isNaN)).toBe(true);
  });

  test('has a range that can be drawn', () => {
    expect(finiteRange([null, 3, NaN, 5])).toEqual([3, 5]);
    expect(finiteRange([2, 2])).toEqual([1.5, 2.5]);
    expect(finiteRange([null])).toBeNull();
  });

  test('is shown in another scale, with a floor below a logarithm', () => {
    expect(rescaled([Math.log(4), null], 'log', 'linear', 0.5)[0]).toBeCloseTo(4);
    expect(rescaled([0, null], 'linear', 'log', 0.5)).toEqual([Math.log(0.5), null]);
    const values = [1, 2];
    expect(rescaled(values, 'log', 'log', 0.5)).toBe(values);
  });
});

describe('ticks', () => {
  test('are round and inside', () => {
    expect(ticks(0, 1, 5)).toHaveLength(6);
    expect(ticks(-0.925, 3.675, 5)).toEqual([0, 1, 2, 3]);
    expect(ticks(3, 3, 5)).toEqual([3]);
  });

  test('carry as many decimals as their step needs', () => {
    expect(scaleMarks(0, 0.5, 5).map(({ text }) => text)).toContain('0.1');
    expect(scaleMarks(0, 500, 5).map(({ text }) => text)).toContain('100');
  });

  test('of a logarithm say the value itself', () => {
    const marks = logMarks(Math.log(3), Math.log(2000), 6);
    expect(marks.map(({ text }) => text)).toEqual(['3', '10', '30', '100', '300', '1000']);
    expect(marks.every(({ at, text }) => Math.abs(Math.exp(at) - Number(text)) < 1e-6)).toBe(true);
    expect(logMarks(Math.log(40), Math.log(60), 4).map(({ text }) => text)).toContain('50');
  });
});

describe('a colour map', () => {
  test('begins and ends with its published colours', () => {
    const table = colourTable('viridis');
    expect([...table.slice(0, 3)]).toEqual([0x44, 0x01, 0x54]);
    expect([...table.slice(-3)]).toEqual([0xfd, 0xe7, 0x25]);
  });

  test.each(['viridis', 'magma', 'cividis'] as const)('%s grows brighter all the way', (name) => {
    const table = colourTable(name);
    const brightness = Array.from(
      { length: 256 },
      (_, i) =>
        0.2126 * (table[i * 3] ?? 0) +
        0.7152 * (table[i * 3 + 1] ?? 0) +
        0.0722 * (table[i * 3 + 2] ?? 0),
    );
    expect(brightness.every((value, i) => i === 0 || value >= (brightness[i - 1] ?? 0) - 0.6)).toBe(
      true,
    );
  });

  test('gives values outside its range the end colours', () => {
    expect(tableIndex(-1, 0, 10)).toBe(0);
    expect(tableIndex(99, 0, 10)).toBe(255);
    expect(tableIndex(5, 5, 5)).toBe(128);
  });
});

describe('a series', () => {
  test('has its last value before gaps and what is only promised', () => {
    expect(lastIndex([1, 2, null, undefined, null])).toBe(1);
    expect(lastIndex([null, undefined])).toBe(-1);
    expect(lastIndex(undefined)).toBe(-1);
  });

  test('shows a gap as a gap', () => {
    const series = { t: [0, 1, 2, 3, 60, 61], v: [1, 2, 3, 4, 5, 6] };
    expect(withGaps(series).v).toEqual([1, 2, 3, 4, null, 5, 6]);
    expect(withGaps({ t: [0, 10, 20, 30], v: [1, 2, 3, 4] }).v).toEqual([1, 2, 3, 4]);
  });

  test('says of its gaps how many there are and when the longest was', () => {
    const series = { t: [0, 1, 2, 30, 31, 32, 90, 91], v: [1, 2, 3, 4, 5, 6, 7, 8] };
    expect(longestGap(withGaps(series))).toEqual({ count: 2, from: 32, to: 90 });
    expect(longestGap(withGaps({ t: [0, 1, 2], v: [1, 2, 3] }))).toBeNull();
  });

  test('of evenly rare reports says nothing of the time between them', () => {
    const rare = { t: [0, 300, 600, 900], v: [0, 0, 0, 0] };
    expect(withGaps(rare, 1500).v).toEqual([0, null, 0, null, 0, null, 0]);
    expect(withGaps({ t: [0, 240], v: [0, 0] })).toEqual({ t: [0, 120, 240], v: [0, null, 0] });
    expect(withGaps({ t: [0, 60], v: [0, 0] }).v).toEqual([0, 0]);
    expect(withGaps({ t: [], v: [] })).toEqual({ t: [], v: [] });
  });

  test('that was thinned for the screen has no gaps but its own', () => {
    const t = Array.from({ length: 1000 }, (_, i) => i * 86);
    const thinned = { t: [...t, 90_000], v: [...t.map(() => 1), 1] };
    expect(withGaps(thinned, 1000).v.indexOf(null)).toBe(1000);
  });

  test('shows as a dot what no line leads to', () => {
    expect(aloneAt([1, null, 2, 3, null, 4])).toEqual([0, 5]);
    expect(aloneAt([1, undefined, 2, null, undefined, 3, undefined])).toEqual([5]);
    expect(aloneAt([null, undefined])).toEqual([]);
    const frame = { across: [0, 4], down: [0, 1], width: 40, height: 10 } as const;
    expect(sparkDots({ t: [-1, 0, 1, 2, 3], v: [1, null, 1, null, 0] }, frame)).toBe(
      'M10.0 10.0h0M30.0 0.0h0',
    );
    const line = { label: 'Depth', unit: 'm', colour: '--text' };
    const { series } = chartOptions({ lines: [line], across: 'time' }, () => '#123456', 300, 100);
    const drawn = { data: [[], [0, null, 5, 6]] } as unknown as uPlot;
    const { filter } = series[1]?.points ?? {};
    expect(typeof filter === 'function' && filter(drawn, 1, false)).toEqual([0]);
  });

  test('stays as thin and as short as it should', () => {
    const series = { t: [0], v: [0 as number | null] };
    expect(append(series, 0.5, 1, 1)).toBe(false);
    expect(append(series, 1, 2, 1)).toBe(true);
    trim(series, 1);
    expect(series).toEqual({ t: [1], v: [2] });
  });

  test('lifts the pen over a gap', () => {
    const frame = { across: [0, 4], down: [0, 1], width: 40, height: 10 } as const;
    const path = sparkPath({ t: [0, 1, 2, 3], v: [0, 1, null, 1] }, frame);
    expect(path).toBe('M0.0 0.0L10.0 10.0M30.0 10.0');
  });

  test('has room in its chart and always shows the surface', () => {
    const [low, high] = padded(2, 4, [0]);
    expect(low).toBeLessThan(0);
    expect(low).toBeGreaterThan(-0.2);
    expect(high).toBeGreaterThan(4);
    expect(padded(null, null, [])).toEqual([0, 1]);
  });
});

describe('a path', () => {
  const spiral: Leg = {
    kind: 'spiral',
    start_ned: [0, 0, 0],
    end_ned: [0, 0, 4],
    speed_m_s: 0.1,
    duration_s: 40,
    energy: 1.5,
    heading_rad: 0,
    radius_m: 2,
    turn_rad: 2 * Math.PI,
  };

  test('of a spiral to starboard closes around a centre to its right', () => {
    const points = legPoints(spiral);
    const last = points.at(-1);
    expect(last?.[0]).toBeCloseTo(0);
    expect(last?.[1]).toBeCloseTo(0);
    expect(last?.[2]).toBe(4);
    expect(points.every(([north, east]) => Math.abs(Math.hypot(north, east - 2) - 2) < 1e-9)).toBe(
      true,
    );
  });

  test('of a spiral to port turns the other way', () => {
    const points = legPoints({ ...spiral, turn_rad: -Math.PI });
    expect(points.at(-1)?.[1]).toBeCloseTo(-4);
  });

  test('of a glide is a line', () => {
    expect(legPoints({ ...spiral, kind: 'glide', radius_m: 0 })).toEqual([
      [0, 0, 0],
      [0, 0, 4],
    ]);
  });

  test('of a track has no hole where the fidelity changes', () => {
    const runs = fidelityRuns({
      north_m: [0, 1, 2],
      east_m: [0, 0, 0],
      fidelity: [2, 2, 0],
      adrift: [],
    });
    expect(runs.map(({ level, points }) => [level, points.length])).toEqual([
      [2, 3],
      [0, 1],
    ]);
  });
});

describe('flags of quality', () => {
  test('mark suspect and bad values, and keep their places beside a gap', () => {
    const series = withGaps({ t: [0, 1, 2, 500, 501], v: [1, 2, 3, 4, 5] });
    expect(series.v).toEqual([1, 2, 3, null, 4, 5]);
    expect(flagColumns(series, [1, 3, 0, 4, 2])).toEqual([
      ['suspect', [null, 2, null, null, null, null]],
      ['bad', [null, null, null, null, 4, null]],
    ]);
  });

  test('are no columns of their own where nothing is doubted', () => {
    expect(flagColumns({ t: [0, 1], v: [1, 2] }, [1, 0])).toEqual([]);
    expect(flagColumns({ t: [0, 1], v: [1, 2] }, [])).toEqual([]);
  });

  test('are drawn by shapes and not by a line', () => {
    const lines = [
      { label: 'Depth', unit: 'm', colour: '--text' },
      { label: 'Bad', unit: '', colour: '--alarm', mark: 'bad' as const },
    ];
    const options = chartOptions({ lines, across: 'time' }, (token) => token, 100, 100);
    expect(options.series[2]).toMatchObject({ width: 0, points: { show: false } });
    expect(options.hooks?.draw).toHaveLength(1);
  });
});
