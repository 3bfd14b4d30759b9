/** Where most flights of a rehearsal were, as shapes on a map. */
import type { FlightBand, NorthEast } from '../api/types';
import { duration } from '../text/time';
import { compact } from '../text/unit';
import { ellipseLine } from './flow_arrow';

/** A place where flights came up. */
export interface BandSurfacing {
  outline: readonly NorthEast[];
  /** When and how often, for a person. */
  text: string;
}

export interface BandShape {
  /** Convex pieces that together cover the band; they overlap, and all go round the same way. */
  pieces: readonly (readonly NorthEast[])[];
  surfacings: readonly BandSurfacing[];
}

/** Columns of a row along the legs: the leg, and the ellipse about the middle of the flights. */
const [LEG, NORTH, EAST, LONG, SHORT, DIRECTION] = [0, 9, 10, 11, 12, 13] as const;

/** The band of a rehearsal from above; `null` where it was not flown often enough. */
export function bandShape(band: FlightBand | null | undefined): BandShape | null {
  if (!band || band.along.length === 0) return null;
  const rings = band.along.map((row) =>
    ellipseLine(row[NORTH], row[EAST], [row[LONG], row[SHORT]], row[DIRECTION]),
  );
  const pieces = rings.flatMap((ring, i) => {
    const next = rings[i + 1];
    const isOneLeg = band.along[i]?.[LEG] === band.along[i + 1]?.[LEG];
    return next && isOneLeg ? [hull([...ring, ...next])] : [];
  });
  const surfacings = band.surfacings.map((one) => ({
    outline: ellipseLine(one.north_m, one.east_m, [...one.ellipse_m], one.ellipse_rad),
    text: surfacingText(one, band.level),
  }));
  return { pieces: pieces.length > 0 ? pieces : rings.map((ring) => hull(ring)), surfacings };
}

/** When most flights came up after a leg, and how far apart. */
export function surfacingText(one: FlightBand['surfacings'][number], level: number): string {
  const [low, middle, high] = one.time_s;
  const often = one.share < 1 ? `; ${Math.round(100 * one.share)} % of the flights do` : '';
  return (
    `Comes up after leg ${one.leg + 1}, ${duration(middle)} after the start` +
    ` (${duration(low)} to ${duration(high)}), within ±${compact(one.ellipse_m[0], 2)} m` +
    ` in ${Math.round(10 * level)} of 10 flights${often}`
  );
}

/** Outline of the smallest convex area around points (Andrew's monotone chain). */
export function hull(points: readonly NorthEast[]): NorthEast[] {
  const sorted = [...points].sort(([a, b], [c, d]) => a - c || b - d);
  const half = (ordered: readonly NorthEast[]) => {
    const kept: NorthEast[] = [];
    for (const point of ordered) {
      while (kept.length > 1 && !turnsLeft(kept.at(-2), kept.at(-1), point)) kept.pop();
      kept.push(point);
    }
    return kept.slice(0, -1);
  };
  return [...half(sorted), ...half(sorted.reverse())];
}

function turnsLeft(a: NorthEast = [0, 0], b: NorthEast = [0, 0], c: NorthEast): boolean {
  return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]) > 0;
}
