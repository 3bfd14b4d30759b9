import { describe, expect, it } from 'vitest';

import type { FlightBand, NorthEast } from '../api/types';
import { bandShape, hull, surfacingText } from './flight_band';

type Row = FlightBand['along'][number];

/** A place on a leg with a circle of one metre about it. */
const row = (leg: number, north: number): Row => [
  ...([leg, 0, 0, 0, 0, 0, 0, 0, 0] as const),
  ...([north, 0, 1, 1, 0, 1] as const),
];
const surfacing: FlightBand['surfacings'][number] = {
  leg: 1,
  share: 0.95,
  time_s: [100, 120, 200],
  north_m: 4,
  east_m: 2,
  ellipse_m: [3, 2],
  ellipse_rad: 0,
  battery: [0.9, 0.91, 0.92],
};
const band = (along: Row[]) =>
  ({ level: 0.9, along, surfacings: [surfacing] }) as unknown as FlightBand;

function area(ring: readonly NorthEast[]): number {
  return ring.reduce((sum, [n, e], i) => {
    const [m, f] = ring[(i + 1) % ring.length] ?? [0, 0];
    return sum + (n * f - m * e) / 2;
  }, 0);
}

describe('the band on a map', () => {
  it('covers what lies between two places of a leg', () => {
    const [piece] = bandShape(band([row(0, 0), row(0, 10)]))?.pieces ?? [];
    // two half circles of 24 corners and what lies between them
    expect(area(piece ?? [])).toBeCloseTo(20 + 12 * Math.sin(Math.PI / 12), 6);
  });

  it('does not lead from one leg to another, and goes round one way', () => {
    const along = [row(0, 0), row(0, 10), row(1, 40), row(1, 30)];
    const pieces = bandShape(band(along))?.pieces ?? [];
    expect(pieces.length).toBe(2);
    expect(pieces.every((piece) => area(piece) > 0)).toBe(true);
  });

  it('is nothing where it was not flown often enough', () => {
    expect(bandShape(null)).toBeNull();
    expect(bandShape(band([]))).toBeNull();
  });

  it('says when and where it comes up', () => {
    const [one] = bandShape(band([row(0, 0)]))?.surfacings ?? [];
    expect(one?.outline[0]).toEqual([7, 2]);
    expect(surfacingText(surfacing, 0.9)).toBe(
      'Comes up after leg 2, 2 min 00 s after the start (1 min 40 s to 3 min 20 s), ' +
        'within ±3.0 m in 9 of 10 flights; 95 % of the flights do',
    );
  });
});

describe('a hull', () => {
  it('leaves out what lies inside', () => {
    const square: NorthEast[] = [
      [0, 0],
      [0, 2],
      [2, 2],
      [2, 0],
    ];
    expect(area(hull([...square, [1, 1], [0.5, 1.5], [0, 1]]))).toBe(4);
    expect(hull([...square, [1, 1], [0, 1]]).length).toBe(4);
  });
});
