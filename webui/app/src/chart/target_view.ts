import type { Box, NorthEast, Site } from '../api/types';
import type { MapView } from './site_map';

/** The part of the water in sight: its middle and the least extents that must be seen, m. */
export interface Sight {
  north: number;
  east: number;
  tall: number;
  wide: number;
}

export function wholeWater({ water }: Pick<Site, 'water'>): Sight {
  return sightOf(water);
}

function sightOf(box: Pick<Box, 'x_min_m' | 'x_max_m' | 'y_min_m' | 'y_max_m'>): Sight {
  return {
    north: (box.x_min_m + box.x_max_m) / 2,
    east: (box.y_min_m + box.y_max_m) / 2,
    tall: box.x_max_m - box.x_min_m,
    wide: box.y_max_m - box.y_min_m,
  };
}

/** Something that must be seen: a place, and the room around it, m. */
export interface Spot {
  at: NorthEast;
  roomM: number;
}

/** Sizes that a sight may have, m; few, so that the picture stands still while things move. */
const STEPS = [1, 1.5, 2, 3, 5, 7.5, 10];

/** A sight of round size and place around some spots; the whole water where that is smaller. */
export function sightAround(spots: readonly Spot[], site: Pick<Site, 'water'>): Sight {
  const whole = wholeWater(site);
  if (spots.length === 0) return whole;
  const norths = spots.flatMap(({ at: [north], roomM }) => [north - roomM, north + roomM]);
  const easts = spots.flatMap(({ at: [, east], roomM }) => [east - roomM, east + roomM]);
  const tall = Math.max(...norths) - Math.min(...norths);
  const wide = Math.max(...easts) - Math.min(...easts);
  const size = roundUp(Math.max(tall, wide, 1) * 1.15);
  if (size >= Math.max(whole.tall, whole.wide) && spots.every((spot) => isWithin(spot, site))) {
    return whole;
  }
  const grid = size / 8;
  const middle = (values: number[]) =>
    Math.round((Math.max(...values) + Math.min(...values)) / 2 / grid) * grid;
  return { north: middle(norths), east: middle(easts), tall: size, wide: size };
}

function isWithin({ at: [north, east] }: Spot, { water }: Pick<Site, 'water'>): boolean {
  const isBetween = (value: number, low: number, high: number) => value >= low && value <= high;
  return (
    isBetween(north, water.x_min_m, water.x_max_m) && isBetween(east, water.y_min_m, water.y_max_m)
  );
}

function roundUp(size: number): number {
  const power = 10 ** Math.floor(Math.log10(size));
  return (STEPS.find((step) => step * power >= size) ?? 10) * power;
}

/** From metres north and east to pixels of a picture, north up, one scale both ways. */
export interface Scale {
  toX: (east: number) => number;
  toY: (north: number) => number;
  /** Pixels of a metre. */
  perM: number;
  width: number;
  height: number;
  /** What the picture really shows, m. */
  norths: [low: number, high: number];
  easts: [low: number, high: number];
}

/** The scale of what a map shows now. */
export function scaleOfView({ perM, width, height, top, left }: MapView): Scale {
  return {
    toX: (east) => (east - left) * perM,
    toY: (north) => (top - north) * perM,
    perM,
    width,
    height,
    norths: [top - height / perM, top],
    easts: [left, left + width / perM],
  };
}

/** A part of a trail that is equally old. */
export interface TrailPart {
  points: NorthEast[];
  /** 1 for the newest, towards 0 for the oldest. */
  freshness: number;
}

const TRAIL_PARTS = 10;

/** A place at a time, s. */
export interface TrailPoint {
  t: number;
  at: NorthEast;
}

/** A stretch of more than this many middle steps was not seen, and is not drawn. */
const GAP_STEPS = 8;

/** A trail cut into parts that fade with age; each begins where the one before ended. */
export function fadingTrail(trail: readonly TrailPoint[], parts = TRAIL_PARTS): TrailPart[] {
  const last = trail.length - 1;
  if (last < 1) return [];
  const each = Math.ceil(last / parts);
  const longest = GAP_STEPS * middleOf(trail.slice(1).map(({ t }, i) => t - (trail[i]?.t ?? t)));
  const result: TrailPart[] = [];
  trail.forEach(({ t, at }, i) => {
    const before = trail[i - 1];
    const part = result.at(-1);
    if (!before) return;
    const isGap = t - before.t > longest;
    if (isGap) result.push({ points: [], freshness: i / last });
    else if (!part || (i - 1) % each === 0) {
      result.push({ points: [before.at, at], freshness: Math.min(1, (i - 1 + each) / last) });
    } else if (part.points.length === 0) part.points.push(before.at, at);
    else part.points.push(at);
  });
  return result.filter(({ points }) => points.length > 0);
}

function middleOf(values: readonly number[]): number {
  return values.toSorted((a, b) => a - b)[Math.floor(values.length / 2)] ?? 0;
}

/** A way up to where it comes back to its start: further rounds would only fill its dashes. */
export function firstRound(way: readonly NorthEast[]): readonly NorthEast[] {
  const start = way[0];
  if (!start) return way;
  let farthest = 0;
  let before = start;
  for (const [i, at] of way.entries()) {
    const step = Math.hypot(at[0] - before[0], at[1] - before[1]);
    const away = Math.hypot(at[0] - start[0], at[1] - start[1]);
    farthest = Math.max(farthest, away);
    if (farthest > 3 * step && away < step) return [...way.slice(0, i), start];
    before = at;
  }
  return way;
}

/** Direction of the last stretch that is long enough to have one, rad from north towards east. */
export function courseOf(points: readonly NorthEast[], leastM: number): number | null {
  const last = points.at(-1);
  if (!last) return null;
  const from = points.findLast(([n, e]) => Math.hypot(last[0] - n, last[1] - e) >= leastM);
  return from ? Math.atan2(last[1] - from[1], last[0] - from[0]) : null;
}
