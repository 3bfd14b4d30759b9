/** What people do with the places of a design. Nothing here changes what it is given. */
import type { Site } from '../../api/types';
import { depthAt } from '../../chart/depth_shade';
import type { Spot } from './document';

type Bathymetry = NonNullable<Site['bathymetry']>;
/** Places by their number in the list, from 0. */
export type Chosen = ReadonlySet<number>;

export function chosenOf(indexes: Iterable<number>): Chosen {
  return new Set(indexes);
}

/** Places are kept to the millimetre. */
const MM = 1000;
const DEPTH_STEPS = 40;

export function at<S extends Spot>(spot: S, north: number, east: number): S {
  return { ...spot, north_m: rounded(north), east_m: rounded(east) };
}

export function moved<S extends Spot>(
  spots: readonly S[],
  chosen: Chosen,
  north: number,
  east: number,
): S[] {
  return changed(spots, chosen, (one) => at(one, one.north_m + north, one.east_m + east));
}

/** Turned clockwise, as headings are counted. */
export function turned<S extends Spot>(
  spots: readonly S[],
  chosen: Chosen,
  rad: number,
  about: Spot,
): S[] {
  const [sin, cos] = [Math.sin(rad), Math.cos(rad)];
  return changed(spots, chosen, (one) => {
    const [north, east] = [one.north_m - about.north_m, one.east_m - about.east_m];
    return at(
      one,
      about.north_m + north * cos - east * sin,
      about.east_m + north * sin + east * cos,
    );
  });
}

export function scaled<S extends Spot>(
  spots: readonly S[],
  chosen: Chosen,
  factor: number,
  about: Spot,
): S[] {
  return changed(spots, chosen, (one) =>
    at(
      one,
      about.north_m + factor * (one.north_m - about.north_m),
      about.east_m + factor * (one.east_m - about.east_m),
    ),
  );
}

/** What came of a change: the places, and which of them are chosen now. */
export interface Edited<S> {
  spots: S[];
  chosen: Set<number>;
}

/** Copies of the chosen places, shifted, behind the last of them. */
export function copied<S extends Spot>(
  spots: readonly S[],
  chosen: Chosen,
  north: number,
  east: number,
): Edited<S> {
  const copies = spots
    .filter((_, i) => chosen.has(i))
    .map((one) => at(one, one.north_m + north, one.east_m + east));
  const behind = Math.max(-1, ...chosen) + 1;
  return {
    spots: spots.toSpliced(behind, 0, ...copies),
    chosen: new Set(copies.map((_, i) => behind + i)),
  };
}

export function inserted<S extends Spot>(spots: readonly S[], index: number, spot: S): Edited<S> {
  const place = at(spot, spot.north_m, spot.east_m);
  return { spots: spots.toSpliced(index, 0, place), chosen: new Set([index]) };
}

/** Without the chosen ones; `null` where too few would be left. */
export function without<S extends Spot>(
  spots: readonly S[],
  chosen: Chosen,
  least: number,
): Edited<S> | null {
  const left = spots.filter((_, i) => !chosen.has(i));
  if (left.length < least || left.length === spots.length) return null;
  const next = Math.min(Math.min(...chosen), left.length - 1);
  return { spots: left, chosen: new Set(next >= 0 ? [next] : []) };
}

/** The chosen ones as one block before the place that now has a number. */
export function reordered<S extends Spot>(
  spots: readonly S[],
  chosen: Chosen,
  before: number,
): Edited<S> {
  const block = spots.filter((_, i) => chosen.has(i));
  const ahead = spots.filter((_, i) => i < before && !chosen.has(i));
  const behind = spots.filter((_, i) => i >= before && !chosen.has(i));
  return {
    spots: [...ahead, ...block, ...behind],
    chosen: new Set(block.map((_, i) => ahead.length + i)),
  };
}

/** The chosen ones one place further up (-1) or down (1). */
export function shifted<S extends Spot>(
  spots: readonly S[],
  chosen: Chosen,
  step: 1 | -1,
): Edited<S> {
  const [first, last] = [Math.min(...chosen), Math.max(...chosen)];
  if (chosen.size === 0 || (step < 0 ? first === 0 : last === spots.length - 1)) {
    return { spots: [...spots], chosen: new Set(chosen) };
  }
  return reordered(spots, chosen, step < 0 ? first - 1 : last + 2);
}

export function reversed<S extends Spot>(spots: readonly S[], chosen: Chosen): S[] {
  const back = spots.filter((_, i) => chosen.has(i)).toReversed();
  let next = 0;
  return spots.map((one, i) => (chosen.has(i) ? (back[next++] ?? one) : one));
}

/** The middle of the box around the chosen places. */
export function middleOf(spots: readonly Spot[], chosen: Chosen): Spot {
  const box = boxAround(spots, chosen);
  return box
    ? { north_m: (box.south + box.north) / 2, east_m: (box.west + box.east) / 2 }
    : { north_m: 0, east_m: 0 };
}

export interface SpotBox {
  south: number;
  north: number;
  west: number;
  east: number;
}

export function boxAround(spots: readonly Spot[], chosen: Chosen): SpotBox | null {
  const box = { south: Infinity, north: -Infinity, west: Infinity, east: -Infinity };
  spots.forEach(({ north_m, east_m }, i) => {
    if (!chosen.has(i)) return;
    box.south = Math.min(box.south, north_m);
    box.north = Math.max(box.north, north_m);
    box.west = Math.min(box.west, east_m);
    box.east = Math.max(box.east, east_m);
  });
  return box.south <= box.north ? box : null;
}

/** Where a place comes to lie. */
export type Snap =
  | { to: 'none' }
  | { to: 'grid'; stepM: number }
  | { to: 'depth'; depthM: number; floor: Bathymetry };

export function snapped(spot: Spot, snap: Snap): Spot {
  if (snap.to === 'grid' && snap.stepM > 0) {
    const step = (value: number) => rounded(Math.round(value / snap.stepM) * snap.stepM);
    return { north_m: step(spot.north_m), east_m: step(spot.east_m) };
  }
  if (snap.to === 'depth') return toDepth(spot, snap.depthM, snap.floor);
  return spot;
}

/**
 * Along the slope of the floor to where it has a depth; the place itself where there is none.
 *
 * Newton's method in the direction of the steepest slope, a cell of the grid a step at most.
 */
export function toDepth(spot: Spot, depthM: number, floor: Bathymetry): Spot {
  const cell = cellOf(floor);
  let [north, east] = [spot.north_m, spot.east_m];
  for (let step = 0; step < DEPTH_STEPS; step++) {
    const miss = depthAt(floor, north, east) - depthM;
    const half = cell / 4;
    const up = (depthAt(floor, north + half, east) - depthAt(floor, north - half, east)) / cell;
    const across = (depthAt(floor, north, east + half) - depthAt(floor, north, east - half)) / cell;
    const [slopeN, slopeE] = [2 * up, 2 * across];
    const steep = slopeN ** 2 + slopeE ** 2;
    if (Math.abs(miss) < 1e-3) break;
    if (steep < 1e-12) return spot;
    const far = Math.min(1, (cell * Math.sqrt(steep)) / Math.abs(miss));
    north -= (far * miss * slopeN) / steep;
    east -= (far * miss * slopeE) / steep;
  }
  const isThere = Math.abs(depthAt(floor, north, east) - depthM) < 0.02 * Math.max(1, depthM);
  return isThere ? { north_m: rounded(north), east_m: rounded(east) } : spot;
}

function cellOf({ north_m: lines }: Bathymetry): number {
  return Math.abs((lines.at(-1) ?? 1) - (lines[0] ?? 0)) / Math.max(1, lines.length - 1);
}

function changed<S>(spots: readonly S[], chosen: Chosen, change: (spot: S) => S): S[] {
  return spots.map((one, i) => (chosen.has(i) ? change(one) : one));
}

function rounded(value: number): number {
  // Adding zero turns a negative zero into a plain one.
  return Math.round(value * MM) / MM + 0;
}

/** How a change of places is called in the list of steps. */
export function naming(verb: string, noun: string, chosen: Chosen): string {
  if (chosen.size !== 1) {
    const many = noun === 'centre' ? 'centres' : `${noun}s`;
    return `${verb} ${chosen.size} ${many}`;
  }
  const [only = 0] = chosen;
  const isOne = noun === 'centre' || noun === 'place';
  return isOne ? `${verb} the ${noun}` : `${verb} ${noun} ${only + 1}`;
}
