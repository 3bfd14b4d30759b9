import { describe, expect, test } from 'vitest';
import type { Comparison, ComparisonRun, Polar } from '../../api/types';
import { contour, joined } from '../../chart/contour';
import { runsOf } from '../../chart/heat_map';
import { drawnPlot, ERROR_PLOTS, INPUT_PLOTS, summaryRows } from './comparison';
import { kindGroups } from './kind_groups';
import { pickTitle } from './pick';
import {
  bestGlide,
  cellFacts,
  curve,
  footing,
  polarCurves,
  quantityOf,
  reach,
  screenValues,
  stabilitySentence,
  usualGlide,
} from './polar';
import { adviceRows, offsetsOf, offsetsText } from './trim';

/** Three buoyancies by three mass positions; the middle row hangs still, one glide is unstable. */
function smallPolar(): Polar {
  const grid = (values: (number | null)[][]) => values;
  const vertical = grid([
    [-0.04, -0.05, -0.06],
    [null, null, null],
    [0.04, 0.05, 0.06],
  ]);
  const horizontal = grid([
    [0.06, 0.1, 0.09],
    [null, null, null],
    [0.06, 0.1, 0.15],
  ]);
  const both = (f: (v: number, h: number) => number) =>
    vertical.map((row, i) =>
      row.map((v, j) => {
        const h = horizontal[i]?.[j] ?? null;
        return v === null || h === null ? null : f(v, h);
      }),
    );
  return {
    vehicle: 'miniglider',
    title: 'Miniglider',
    note: '',
    m0_kg: [-0.01, 0, 0.01],
    rp1_m: [-0.02, 0, 0.02],
    speed_m_s: both(Math.hypot),
    glide_angle_rad: both((v, h) => -Math.atan2(v, h)),
    pitch_rad: both((v, h) => -Math.atan2(v, h) + 0.05),
    angle_of_attack_rad: both(() => 0.05),
    vertical_speed_m_s: vertical,
    horizontal_speed_m_s: horizontal,
    greatest_growth_per_s: both((v) => (v === 0.06 ? 0.2 : -0.1)),
    stable: both((v) => (v === 0.06 ? 0 : 1)).map((row) =>
      row.map((value) => (value === null ? null : value === 1)),
    ),
  };
}

describe('a polar', () => {
  const polar = smallPolar();

  test('tells stable, unstable and impossible glides apart', () => {
    expect(footing(polar, 0, 0)).toBe('stable');
    expect(footing(polar, 2, 2)).toBe('unstable');
    expect(footing(polar, 1, 1)).toBe('impossible');
  });

  test('has holes, not zeros, where there is no glide', () => {
    const values = screenValues(polar, quantityOf('vertical_speed_m_s'));
    expect([...values.slice(0, 3)]).toEqual([-4, -5, -6]);
    expect([...values.slice(3, 6)].every(Number.isNaN)).toBe(true);
  });

  test('reads every value of a cell in the units of the screen', () => {
    const facts = Object.fromEntries(
      cellFacts(polar, 0, 1).map(({ title, text }) => [title, text]),
    );
    expect(facts).toMatchObject({
      Speed: '11.2 cm/s',
      'Vertical speed': '−5.0 cm/s',
      'Horizontal speed': '10.0 cm/s',
      'Glide angle': '26.6 °',
      'Angle of attack': '2.9 °',
      Stability: '−0.100 1/s',
    });
    expect(cellFacts(polar, 1, 1)).toEqual([]);
  });

  test('breaks a curve where no glide is, so that down and up are not joined', () => {
    const { runs } = curve(polar, 1);
    expect(runs.map((run) => run.map(({ vertical }) => vertical))).toEqual([[-0.05], [0.05]]);
  });

  test('picks curves over all mass positions that glide', () => {
    expect(polarCurves(polar, 2).map(({ massPositionM }) => massPositionM)).toEqual([-0.02, 0.02]);
    expect(polarCurves(polar, 9)).toHaveLength(3);
  });

  test('marks the flattest stable glide, not a flatter one that no robot holds', () => {
    const best = bestGlide(polar, 'down');
    expect(best).toMatchObject({ row: 2, column: 1 });
    expect(best && reach(best)).toBeCloseTo(2);
    expect(bestGlide(polar, 'up')).toMatchObject({ row: 0, column: 1 });
  });

  test('says how fast a disturbance dies away or grows', () => {
    const eigenvalues = [
      { real: -2, imag: 1 },
      { real: -Math.LN2 / 5, imag: 0 },
    ];
    expect(stabilitySentence({ stable: true, eigenvalues })).toBe(
      'Stable: a disturbance halves every 5.0 s at the slowest.',
    );
    expect(
      stabilitySentence({ stable: false, eigenvalues: [{ real: Math.LN2 / 200, imag: 0 }] }),
    ).toContain('doubles every 200 s');
  });
});

describe('a contour', () => {
  test('crosses cells where the value is met, and leaves holes out', () => {
    const values = Float64Array.from([0, 1, 2, 0, 1, 2]);
    expect(contour(values, 3, 2, 0.5)).toEqual([[0.5, 0, 0.5, 1]]);
    expect(contour(Float64Array.from([0, NaN, 2, 0, 1, 2]), 3, 2, 0.5)).toEqual([]);
    expect(contour(values, 3, 2, 9)).toEqual([]);
  });

  test('keeps the two lines of a saddle apart', () => {
    const pieces = contour(Float64Array.from([1, 0, 0, 1]), 2, 2, 0.4);
    expect(pieces).toHaveLength(2);
    // The high corners belong together, so no line crosses the diagonal between them.
    expect(pieces.every(([x0, y0, x1, y1]) => x0 > y0 === x1 > y1)).toBe(true);
  });

  test('marks of cells are joined along a row and never over its end', () => {
    const marks = [null, 'hatched', 'hatched', 'hatched', null, 'dotted'] as const;
    expect(runsOf(marks, 3)).toEqual([
      { mark: 'hatched', row: 0, from: 1, to: 3 },
      { mark: 'hatched', row: 1, from: 0, to: 1 },
      { mark: 'dotted', row: 1, from: 2, to: 3 },
    ]);
  });
});

function run(title: string, rms: number, energy: number | null): ComparisonRun {
  const values = [rms, rms / 2, null];
  const band = { low: [0, 0, 0], high: [rms * 2, rms, 1] };
  return {
    kind: `controller.${title}`,
    title,
    north_m: values,
    east_m: values,
    depth_m: values,
    pitch_rad: values,
    errors: { depth_m: values, horizontal_m: values, pitch_rad: values, hybrid_rad: values },
    band: { depth_m: band, horizontal_m: band, pitch_rad: band },
    inputs: { m0_kg: [0.01, 0.02, 0.02], rp1_m: values, delta_rad: values },
    summary: {
      depth_rms_m: rms,
      horizontal_rms_m: 0.5,
      horizontal_end_m: rms,
      pitch_rms_rad: Math.PI / 180,
      hybrid_rms_rad: null,
      travel: { m0_kg: rms, rp1_m: rms, delta_rad: 0 },
      energy_j: energy,
    },
  };
}

function comparison(seeds: number[]): Comparison {
  const values = [0, 0, 0];
  return {
    time_s: [0, 1, 2],
    reference: { north_m: values, east_m: values, depth_m: values, pitch_rad: values },
    runs: [run('one', 0.2, 20), run('two', 0.1, null)],
    seeds,
    vehicle: 'miniglider',
    note: '',
  };
}

describe('a comparison', () => {
  const [depth, , pitch] = ERROR_PLOTS;
  const [buoyancy] = INPUT_PLOTS;
  if (!depth || !pitch || !buoyancy) throw new Error('there are such plots');

  test('draws a line a controller, then the edges of its band', () => {
    const { lines, data, bands } = drawnPlot(comparison([0, 1]), depth);
    expect(lines.map(({ label, isEdge = false }) => [label, isEdge])).toEqual([
      ['one', false],
      ['two', false],
      ['one, high', true],
      ['one, low', true],
      ['two, high', true],
      ['two, low', true],
    ]);
    expect(bands.map(({ high, low }) => [high, low])).toEqual([
      [3, 4],
      [5, 6],
    ]);
    expect(data[3]).toEqual([0.4, 0.2, 1]);
    expect(data[1]).toEqual([0.2, 0.1, null]);
    expect(data).toHaveLength(lines.length + 1);
  });

  test('of one seed has no band', () => {
    expect(drawnPlot(comparison([7]), depth).bands).toEqual([]);
  });

  test('tells controllers apart by dash as well as colour', () => {
    const { lines } = drawnPlot(comparison([7]), depth);
    expect(new Set(lines.map(({ dash }) => String(dash))).size).toBe(2);
    expect(new Set(lines.map(({ colour }) => colour)).size).toBe(2);
  });

  test('shows angles in degrees and buoyancy in grams', () => {
    expect(drawnPlot(comparison([7]), pitch).lines[0]?.unit).toBe('°');
    expect(drawnPlot(comparison([7]), buoyancy).data[1]).toEqual([10, 20, 20]);
  });

  test('sums up with the best marked, and none where all are alike or only one is known', () => {
    const rows = Object.fromEntries(
      summaryRows(comparison([7]).runs).map((row) => [row.title, row]),
    );
    expect(rows['Depth error, RMS']).toMatchObject({
      texts: ['20.0', '10.0'],
      best: [1],
      unit: 'cm',
    });
    expect(rows['Horizontal error, RMS']?.best).toEqual([]);
    expect(rows.Energy).toMatchObject({ texts: ['20.0', '–'], best: [] });
    expect(rows['Pitch error, RMS']?.texts).toEqual(['1.00', '1.00']);
  });

  test('names a second controller of a kind so that plots can tell them apart', () => {
    const kinds = [{ kind: 'controller.pid', title: 'PID', robots: [] }];
    expect(pickTitle(kinds, 'controller.pid', [])).toBe('PID');
    expect(pickTitle(kinds, 'controller.pid', [{ title: 'PID' }])).toBe('PID 2');
  });
});

describe('a trim', () => {
  test('has a sign, because it is a change', () => {
    expect(offsetsText({ net_buoyancy_offset_kg: 0.0021, mass_position_offset_m: -0.0004 })).toBe(
      '+2.10 g, −0.4 mm',
    );
    expect(offsetsText(offsetsOf({}))).toBe('0.00 g, 0.0 mm');
  });

  test('advice puts now beside proposed with how sure it is', () => {
    const offsets = { net_buoyancy_offset_kg: 0.002, mass_position_offset_m: 0.001 };
    const advice = {
      id: 'advice-1',
      dives: 4,
      ...offsets,
      net_buoyancy_std_kg: 0.0003,
      mass_position_std_m: 0.0002,
      rmse_now: { depth_rate_m_s: 0.004, pitch_rad: 0.02 },
      rmse_proposed: { depth_rate_m_s: 0.001, pitch_rad: 0.01 },
      half_step: offsets,
      full_step: offsets,
      message: '',
      present: offsetsOf({}),
      is_worth_it: true,
    };
    const rows = adviceRows(advice, advice.present);
    expect(rows[0]).toMatchObject({ now: '0.00 g', proposed: '+2.0 ± 0.3 g' });
    expect(rows[2]).toMatchObject({ now: '4.0 mm/s', proposed: '1.0 mm/s' });
    expect(rows[3]).toMatchObject({ now: '1.15 °', proposed: '0.57 °' });
  });
});

test('kinds of settings are grouped by what they decide, and none is lost', () => {
  const kind = (key: string) => ({ kind: key, title: '', robots: [] });
  const groups = kindGroups(['trim', 'controller.pid', 'planner', 'other'].map(kind));
  expect(groups.map(({ title, kinds }) => [title, kinds.map((each) => each.kind)])).toEqual([
    ['Survey', ['planner']],
    ['Controllers', ['controller.pid']],
    ['Vehicle', ['trim']],
    ['Other', ['other']],
  ]);
  expect(groups[1]?.kinds[0]?.title).toBe('Pid');
});

test('lines of equal value are named one by one', () => {
  const apart = joined([
    [0, 0, 1, 0],
    [5, 5, 6, 5],
    [2, 0, 1, 0],
  ]);
  expect(apart.map(({ length }) => length)).toEqual([2, 1]);
});

test('the usual glide is the same part of every glider’s range', () => {
  expect(usualGlide({ m0_kg: [-0.0279, 0.0225], rp1_m: [-0.0555, 0.0445] })).toEqual({
    m0_kg: 0.01,
    rp1_m: 0.02,
  });
  expect(usualGlide({ m0_kg: [-0.23, 0.189], rp1_m: [-0.139, 0.11125] })).toEqual({
    m0_kg: 0.084,
    rp1_m: 0.05,
  });
});
