import { describe, expect, test } from 'vitest';
import type { Site } from '../../api/types';
import { gripAt, type Gripped } from '../../chart/spot_gesture';
import {
  placed,
  PLAIN_MANNER,
  PLAIN_SURFACING,
  ruleOf,
  same,
  spotsOf,
  withSpots,
} from './document';
import type { Content, Design, Waypoint } from './document';
import {
  estimate,
  leftOfFlights,
  legFigures,
  scaledTo,
  type Checked,
  type Rates,
} from './estimate';
import { begun, KINDS, titleOf } from './kinds';
import { parsePlace, placeText } from './place_text';
import {
  copied,
  inserted,
  moved,
  naming,
  reordered,
  reversed,
  scaled,
  shifted,
  snapped,
  turned,
  without,
} from './spots';

const DOMAIN = {
  x_min_m: 0,
  x_max_m: 400,
  y_min_m: 0,
  y_max_m: 200,
  depth_max_m: 15,
} as Site['domain'];
const LAKE = { origin_latitude_deg: 42.76, origin_longitude_deg: -84.38 };

const at = (north_m: number, east_m: number, name = ''): Waypoint => ({ north_m, east_m, name });
const LINE = [at(0, 0, 'a'), at(0, 10, 'b'), at(0, 20, 'c'), at(0, 30, 'd')];
const names = (spots: readonly Waypoint[]) => spots.map(({ name }) => name).join('');

function way(waypoints: readonly Waypoint[]): Design {
  const content: Content = { kind: 'waypoints', waypoints, returns: false };
  return { content, manner: PLAIN_MANNER, surfacing: PLAIN_SURFACING };
}

describe('places of a design', () => {
  test('of every kind can be read and put back', () => {
    for (const kind of KINDS) {
      const { content } = begun(kind, DOMAIN);
      const spots = spotsOf(content);
      expect(same(withSpots(content, spots), content)).toBe(true);
      expect(spots.length).toBeGreaterThanOrEqual(ruleOf(content).least);
    }
  });

  test('are turned clockwise about their middle and come back after four quarters', () => {
    const all = new Set([0, 1]);
    const two = [at(1, 0), at(-1, 0)];
    const quarter = turned(two, all, Math.PI / 2, at(0, 0));
    expect(quarter[0]).toMatchObject({ north_m: 0, east_m: 1 });
    let round = two;
    for (let i = 0; i < 4; i++) round = turned(round, all, Math.PI / 2, at(0, 0));
    expect(round).toEqual(two);
  });

  test('are moved and scaled without those that are not chosen', () => {
    const chosen = new Set([1]);
    expect(moved(LINE, chosen, 5, -1)[1]).toMatchObject({ north_m: 5, east_m: 9, name: 'b' });
    expect(moved(LINE, chosen, 5, -1)[0]).toBe(LINE[0]);
    expect(scaled(LINE, chosen, 2, at(0, 0))[1]).toMatchObject({ east_m: 20 });
  });

  test('go as a block where they are dragged, and stay chosen', () => {
    const down = reordered(LINE, new Set([0, 1]), 3);
    expect([names(down.spots), [...down.chosen]]).toEqual(['cabd', [1, 2]]);
    const up = reordered(LINE, new Set([1, 3]), 0);
    expect([names(up.spots), [...up.chosen]]).toEqual(['bdac', [0, 1]]);
  });

  test('go one place up or down, and not beyond the ends', () => {
    expect(names(shifted(LINE, new Set([2]), -1).spots)).toBe('acbd');
    expect(names(shifted(LINE, new Set([1]), 1).spots)).toBe('acbd');
    expect(names(shifted(LINE, new Set([0]), -1).spots)).toBe('abcd');
    expect(names(shifted(LINE, new Set([3]), 1).spots)).toBe('abcd');
  });

  test('are copied behind the last of them, and reversed in their own places', () => {
    const { spots, chosen } = copied(LINE, new Set([0, 1]), 1, 0);
    expect([names(spots), [...chosen]]).toEqual(['ababcd', [2, 3]]);
    expect(names(reversed(LINE, new Set([0, 1, 3])))).toBe('dbca');
  });

  test('are inserted and deleted, but never fewer than there must be', () => {
    expect(names(inserted(LINE, 1, at(0, 5, 'x')).spots)).toBe('axbcd');
    expect(without(LINE, new Set([0, 1]), 3)).toBeNull();
    expect(names(without(LINE, new Set([0]), 3)?.spots ?? [])).toBe('bcd');
    expect(without([at(0, 0)], new Set([0]), 0)?.chosen.size).toBe(0);
  });

  test('come to lie on a grid, or where the floor has a depth', () => {
    expect(snapped(at(12.4, -7.6), { to: 'grid', stepM: 5 })).toMatchObject({
      north_m: 10,
      east_m: -10,
    });
    const lines = Array.from({ length: 11 }, (_, i) => i * 10);
    // The floor falls by a tenth of a metre each metre to the east.
    const floor = {
      north_m: lines,
      east_m: lines,
      depth_m: lines.map(() => lines.map((east) => east / 10)),
    };
    const there = snapped(at(50, 20), { to: 'depth', depthM: 6.25, floor });
    expect(there.east_m).toBeCloseTo(62.5, 2);
    expect(there.north_m).toBeCloseTo(50, 2);
    const nowhere = at(50, 20);
    expect(snapped(nowhere, { to: 'depth', depthM: 99, floor })).toBe(nowhere);
  });

  test('are named as people call them', () => {
    expect(naming('Moved', 'waypoint', new Set([2]))).toBe('Moved waypoint 3');
    expect(naming('Moved', 'waypoint', new Set([2, 4]))).toBe('Moved 2 waypoints');
    expect(naming('Moved', 'centre', new Set([0]))).toBe('Moved the centre');
    expect(titleOf({ kind: 'lawnmower', is_crossed: true })).toBe('Cross-hatch');
  });

  test('are written and read in every notation to a centimetre or better', () => {
    const spot = { north_m: 123.456, east_m: -78.9 };
    const reach = { degrees: 0.8, minutes: 1.3, seconds: 2, metres: 0.0005 } as const;
    for (const format of ['degrees', 'minutes', 'seconds', 'metres'] as const) {
      const back = parsePlace(LAKE, placeText(LAKE, spot, format), format);
      expect(Math.abs((back?.north_m ?? NaN) - spot.north_m)).toBeLessThan(reach[format]);
      expect(Math.abs((back?.east_m ?? NaN) - spot.east_m)).toBeLessThan(reach[format]);
    }
    expect(parsePlace(LAKE, '12,5', 'metres')).toEqual({ north_m: 12, east_m: 5 });
    expect(parsePlace(LAKE, 'somewhere', 'metres')).toBeNull();
    expect(parsePlace(LAKE, '99, 200', 'degrees')).toBeNull();
  });
});

describe('a pointer', () => {
  const grips: Gripped[] = [
    { grip: { kind: 'leg', index: 0 }, at: { x: 10, y: 10 } },
    { grip: { kind: 'spot', index: 3 }, at: { x: 14, y: 10 } },
  ];

  test('takes the nearest in its reach, and a place before a leg', () => {
    expect(gripAt(grips, { x: 9, y: 10 }, 11)).toEqual({ kind: 'leg', index: 0 });
    expect(gripAt(grips, { x: 12, y: 10 }, 11)).toEqual({ kind: 'spot', index: 3 });
    expect(gripAt(grips, { x: 40, y: 10 }, 11)).toBeNull();
  });
});

const RATES: Rates = {
  glideSpeed: 0.05,
  swimSpeed: 0.1,
  glideEnergy: 1.5,
  swimFactor: 0.2,
  timeFactor: 0.005,
  tailAmplitude: 0.35,
  tailFrequency: 1,
  turnTime: 20,
  fixStd: 0.1,
  drift: 0.02,
  usualDeep: 5,
  usualAngle: Math.PI / 4,
};

describe('the estimate', () => {
  test('counts glides, their time and the surfacings between them', () => {
    // At 45 degrees 20 m ahead are 20 m of depth: twice down to 5 m and up again.
    const leg = legFigures(RATES, at(0, 0), at(20, 0), PLAIN_MANNER);
    expect(leg.duration_s).toBeCloseTo(20 / 0.05 + 2 * 20, 6);
    expect(leg.energy).toBeCloseTo(4 * 1.5 + 0.005 * leg.duration_s, 6);
  });

  test('grows with the way and keeps to waypoints', () => {
    const short = estimate(RATES, way(LINE.slice(0, 2)));
    const long = estimate(RATES, way(LINE));
    expect(long?.distance_m).toBe(30);
    expect(long?.energy).toBeGreaterThan(short?.energy ?? Infinity);
    expect(estimate(RATES, way([]))).toBeNull();
    const [, lawnmower] = KINDS;
    expect(lawnmower && estimate(RATES, begun(lawnmower, DOMAIN))).toBeNull();
  });

  const range = (mean: number, off: number) => ({ mean, low: mean - off, high: mean + off });
  const AFTER = {
    left: range(0.68, 0.03),
    left_wh: range(68, 3),
    used_wh: range(12, 3),
    there: 0.02,
    home: null,
    home_m: null,
    reserve: 0.1,
    capacity_wh: 100,
    is_learned: false,
  };

  test('says exactly what the station said as long as nothing is changed', () => {
    const design = way(LINE);
    const model = estimate(RATES, design);
    const checked: Checked = {
      account: {
        duration_s: 900,
        energy: 40,
        distance_m: 30,
        surfacings: 7,
        worst_std_m: 2,
        energy_wh: 12,
        battery_left: 0.8,
        battery_after: AFTER,
        satellite_bytes: 700,
        credits: 3,
      },
      model,
      wayThere: { distance_m: 10, duration_s: 100, energy: 4 },
    };
    expect(model && scaledTo(model, checked)).toEqual(checked.account);
    const double = estimate(RATES, way(LINE.map((one) => at(0, 2 * one.east_m))));
    const guess = double && scaledTo(double, checked);
    expect(guess?.distance_m).toBeCloseTo(60, 6);
    expect(guess?.duration_s).toBeGreaterThan(900);
    expect(guess?.duration_s).toBeLessThan(2 * 900);
    const times = (guess?.energy ?? 0) / 40;
    expect(guess?.battery_after?.used_wh.mean).toBeCloseTo(times * 12, 6);
    expect(guess?.battery_after?.left_wh.mean).toBeCloseTo(80 - times * 12, 6);
  });

  test('pays the way there and the way home from the charge that flights ahead ended with', () => {
    const flown = (...battery_end: [number, number, number]) => ({
      battery_end,
      over_time: [[0, ...Array<number>(9).fill(0), 0.8, 0.8, 0.8, 1]],
    });
    const alone = leftOfFlights(AFTER, 0.8, flown(0.5, 0.6, 0.7));
    expect(alone.left.mean).toBeCloseTo(0.58, 9);
    expect([alone.left.low, alone.left.high].map((one) => one.toFixed(2))).toEqual([
      '0.48',
      '0.68',
    ]);
    expect(alone.home).toBeNull();
    const later = leftOfFlights(AFTER, 0.7, flown(0.5, 0.6, 0.7));
    expect(later.left.mean).toBeCloseTo(0.48, 9);
    const home = { ...AFTER, home: range(0.63, 0.04) };
    const back = leftOfFlights(home, 0.8, flown(0.03, 0.6, 0.7));
    expect(back.home?.mean).toBeCloseTo(0.53, 9);
    expect(back.home?.low).toBe(0);
  });

  test('leaves everything else of a design as it is when a place moves', () => {
    const design = way(LINE);
    const next = placed(design, moved(LINE, new Set([0]), 1, 1));
    expect(next.manner).toBe(design.manner);
    expect(same(next, design)).toBe(false);
    expect(same({ a: 1, b: null }, { a: 1 })).toBe(true);
  });
});
