import { describe, expect, test } from 'vitest';
import { ellipse95 } from './ellipse';
import {
  courseOf,
  fadingTrail,
  firstRound,
  scaleOfView,
  sightAround,
  wholeWater,
} from './target_view';

const TANK = {
  water: { x_min_m: -1, x_max_m: 3, y_min_m: -1, y_max_m: 2, depth_max_m: 1.2 },
};
const LAKE = {
  water: { x_min_m: 0, x_max_m: 500, y_min_m: 0, y_max_m: 500, depth_max_m: 20 },
};

describe('an error ellipse', () => {
  test('of equal variances is the circle that holds 95 %', () => {
    const circle = ellipse95([0.04, 0, 0.04]);
    expect(circle?.longM).toBeCloseTo(0.2 * 2.4477, 4);
    expect(circle?.shortM).toBeCloseTo(circle?.longM ?? 0, 12);
  });

  test('lies along the direction of the greater variance, from north towards east', () => {
    expect(ellipse95([4, 0, 1])?.directionRad).toBeCloseTo(0);
    expect(Math.abs(ellipse95([1, 0, 4])?.directionRad ?? 0)).toBeCloseTo(Math.PI / 2);
    const slanted = ellipse95([2.5, 1.5, 2.5]);
    expect(slanted?.directionRad).toBeCloseTo(Math.PI / 4);
    expect(slanted?.longM).toBeCloseTo(2 * 2.4477, 3);
    expect(slanted?.shortM).toBeCloseTo(1 * 2.4477, 3);
  });

  test('is not drawn of numbers that are no covariance', () => {
    expect(ellipse95([1, 2, 1])).toBeNull();
    expect(ellipse95([NaN, 0, 1])).toBeNull();
    expect(ellipse95([-1, 0, -1])).toBeNull();
  });

  test('of a rounded covariance is as thin as a line, not absent', () => {
    expect(ellipse95([1, 1.0000001, 1])?.shortM).toBe(0);
  });
});

describe('the part of the water in sight', () => {
  test('stands still while things move a little', () => {
    const near = (north: number) => [
      { at: [north, 250] as const, roomM: 0 },
      { at: [270, 262] as const, roomM: 5 },
    ];
    expect(sightAround(near(251), LAKE)).toEqual(sightAround(near(251.4), LAKE));
  });

  test('holds everything that must be seen', () => {
    const sight = sightAround([{ at: [100, 100], roomM: 30 }], LAKE);
    expect(sight.tall).toBeGreaterThanOrEqual(60);
    expect(sight.north + sight.tall / 2).toBeGreaterThanOrEqual(130);
    expect(sight.north - sight.tall / 2).toBeLessThanOrEqual(70);
  });

  test('is all of the water where that is smaller, or where nothing is known', () => {
    expect(sightAround([{ at: [1, 1], roomM: 2 }], TANK)).toEqual(wholeWater(TANK));
    expect(sightAround([], TANK)).toEqual(wholeWater(TANK));
  });

  test('goes beyond the water after what has left it', () => {
    const sight = sightAround(
      [
        { at: [0, 0], roomM: 0 },
        { at: [9, 0], roomM: 0 },
      ],
      TANK,
    );
    expect(sight.north + sight.tall / 2).toBeGreaterThanOrEqual(9);
  });
});

describe('the picture from above', () => {
  test('has north up and the same scale both ways', () => {
    const scale = scaleOfView({ perM: 20, width: 400, height: 220, top: 5.5, left: -10 });
    expect([scale.toX(0), scale.toY(0)]).toEqual([200, 110]);
    expect(scale.toY(1)).toBe(90);
    expect(scale.toX(1)).toBe(220);
    expect(scale.norths).toEqual([-5.5, 5.5]);
  });

  test('fades a trail with age and joins its parts', () => {
    const trail = Array.from({ length: 21 }, (_, t) => ({ t, at: [t, 0] as const }));
    const parts = fadingTrail(trail, 4);
    expect(parts).toHaveLength(4);
    expect(parts[1]?.points[0]).toEqual(parts[0]?.points.at(-1));
    expect(parts.map(({ freshness }) => freshness)).toEqual([0.25, 0.5, 0.75, 1]);
    expect(parts.at(-1)?.points.at(-1)).toEqual([20, 0]);
  });

  test('draws nothing over a time in which the robot was not seen', () => {
    const trail = [0, 1, 2, 3, 100, 101, 102].map((t) => ({ t, at: [t, 0] as const }));
    const parts = fadingTrail(trail, 2);
    const ends = parts.map(({ points }) => [points[0]?.[0], points.at(-1)?.[0]]);
    expect(ends).not.toContainEqual([3, 100]);
    expect(
      parts.every(({ points }) => (points.at(-1)?.[0] ?? 0) - (points[0]?.[0] ?? 0) < 50),
    ).toBe(true);
    expect(fadingTrail(trail.slice(0, 1))).toEqual([]);
  });

  test('draws one round of a way that goes round and round, and all of one that does not', () => {
    const round = Array.from({ length: 50 }, (_, i) => {
      return [Math.cos(i / 3), Math.sin(i / 3)] as const;
    });
    const first = firstRound(round);
    expect(first.length).toBeLessThan(23);
    expect(first.at(-1)).toEqual(first[0]);
    const straight = Array.from({ length: 50 }, (_, i) => [i, 0] as const);
    expect(firstRound(straight)).toEqual(straight);
    expect(firstRound([[1, 1], [1, 1], [1, 1]])).toHaveLength(3); // prettier-ignore
  });

  test('takes a course from a step that is long enough', () => {
    expect(courseOf([[0, 0], [0, 1], [0, 1.001]], 0.5)).toBeCloseTo(Math.PI / 2); // prettier-ignore
    expect(courseOf([[0, 0]], 0.5)).toBeNull();
  });
});
