import { describe, expect, it } from 'vitest';
import type { Leg, Site } from '../../api/types';
import { bodyOf, faultsOf, fromPlan, toneOf } from './waypoint';

const water = { x_min_m: 0, x_max_m: 50, y_min_m: 0, y_max_m: 50, depth_max_m: 20 };
const site = { name: 'Bay', water } as Site;
const good = { north_m: 1, east_m: 2, depth_m: 3, hold_s: 0 };

describe('waypoints', () => {
  it('are refused above the surface, below the water, and without a number', () => {
    const rows = [
      good,
      { ...good, depth_m: -10 },
      { ...good, depth_m: 21 },
      { ...good, east_m: NaN },
      { ...good, east_m: 99_999 },
    ];
    expect(faultsOf(rows, site)).toEqual([
      { row: 1, text: 'Waypoint 2 is above the surface.' },
      { row: 2, text: 'Waypoint 3 is deeper than the water, 20 m.' },
      { row: 3, text: 'Waypoint 4 needs a number in each field.' },
      { row: 4, text: 'Waypoint 5 lies outside of Bay.' },
    ]);
  });

  it('are sent without what the vehicle said besides', () => {
    expect(bodyOf({ ...good, command: 'waypoint' } as typeof good)).toEqual(good);
  });

  it('are good news only once they are on board', () => {
    expect(['on_board', 'refused', 'unknown'].map((one) => toneOf(one as never))).toEqual([
      'ok',
      'alarm',
      'watch',
    ]);
  });
});

describe('a plan of one of our robots', () => {
  const leg = (kind: Leg['kind'], end: [number, number, number]) =>
    ({ kind, start_ned: [0, 0, 0], end_ned: end }) as unknown as Leg;

  it('becomes the ends of its legs, and what is lost is said', () => {
    const { rows, lost } = fromPlan({
      legs: [
        leg('glide', [10.04, 5, 8]),
        leg('spiral', [10, 5, 12.26]),
        leg('glide', [20, 5, -0.01]),
      ],
    });
    expect(rows.map(({ north_m, depth_m }) => [north_m, depth_m])).toEqual([
      [10, 8],
      [10, 12.3],
      [20, 0],
    ]);
    expect(lost[0]).toBe('Spirals become straight ways to their ends: leg 2.');
    expect(lost[1]).toBe('Glides lose their angle and speed: leg 1, 3.');
  });

  it('of swims alone loses no angle', () => {
    expect(fromPlan({ legs: [leg('swim', [1, 2, 0])] }).lost).toHaveLength(1);
  });
});
