/** The floor of a water as a regular grid to be shaded, and its lines of equal depth. */
import type { Site } from '../api/types';
import { contour, joined, type Piece } from './contour';
import { ticks } from './slice';

type Bathymetry = NonNullable<Site['bathymetry']>;

/** Depths row by row from the north-west; a cell is a point, the outermost on the edges. */
export interface DepthGrid {
  width: number;
  height: number;
  values: Float64Array;
  north: readonly [low: number, high: number];
  east: readonly [low: number, high: number];
  deepest: number;
}

export interface Isobath {
  depthM: number;
  /** Ends of its pieces, north and east, m. */
  pieces: [[number, number], [number, number]][];
  /** Where its depth is written. */
  labels: [north: number, east: number][];
}

const LEVELS = 6;
/** A line of fewer pieces has no room for its number. */
const LEAST_PIECES = 10;
const LABELS_MAX = 4;

/** The floor on a regular grid of at most `side` points either way, bilinear in between. */
export function depthGrid(floor: Bathymetry, side: number): DepthGrid {
  const ends = (lines: readonly number[]) => [lines[0] ?? 0, lines.at(-1) ?? 1] as const;
  const [north, east] = [ends(floor.north_m), ends(floor.east_m)];
  const tall = north[1] - north[0];
  const wide = east[1] - east[0];
  const width = Math.max(2, Math.round(side * Math.min(1, wide / tall)));
  const height = Math.max(2, Math.round(side * Math.min(1, tall / wide)));
  const at = (low: number, high: number, i: number, count: number) =>
    low + ((high - low) * i) / (count - 1);
  const rows = Array.from({ length: height }, (_, i) =>
    between(floor.north_m, at(north[1], north[0], i, height)),
  );
  const columns = Array.from({ length: width }, (_, i) =>
    between(floor.east_m, at(east[0], east[1], i, width)),
  );
  const values = new Float64Array(width * height);
  let deepest = 0;
  rows.forEach(([row, up], y) => {
    const [south, beyond] = [floor.depth_m[row] ?? [], floor.depth_m[row + 1] ?? []];
    columns.forEach(([column, across], x) => {
      const mix = (line: readonly number[]) =>
        (line[column] ?? 0) * (1 - across) + (line[column + 1] ?? 0) * across;
      const depth = mix(south) * (1 - up) + mix(beyond) * up;
      values[y * width + x] = depth;
      deepest = Math.max(deepest, depth);
    });
  });
  return { width, height, values, north, east, deepest };
}

/** Depth of the floor at a place, m; as at the outermost lines beyond them. */
export function depthAt(floor: Bathymetry, north: number, east: number): number {
  const [row, up] = between(floor.north_m, north);
  const [column, across] = between(floor.east_m, east);
  const mix = (line: readonly number[] = []) =>
    (line[column] ?? 0) * (1 - across) + (line[column + 1] ?? 0) * across;
  return mix(floor.depth_m[row]) * (1 - up) + mix(floor.depth_m[row + 1]) * up;
}

/** Lines of equal depth at round depths. */
export function isobaths(grid: DepthGrid): Isobath[] {
  const { width, height, values, north, east } = grid;
  const place = (x: number, y: number): [number, number] => [
    north[1] - ((north[1] - north[0]) * y) / (height - 1),
    east[0] + ((east[1] - east[0]) * x) / (width - 1),
  ];
  return ticks(0, grid.deepest, LEVELS)
    .filter((depth) => depth > 0 && depth < grid.deepest)
    .map((depthM) => {
      const pieces = contour(values, width, height, depthM);
      return {
        depthM,
        pieces: pieces.map(([x0, y0, x1, y1]) => [place(x0, y0), place(x1, y1)]),
        labels: labelled(pieces).map(([x, y]) => place(x, y)),
      };
    });
}

function labelled(pieces: readonly Piece[]): [number, number][] {
  return joined(pieces)
    .filter(({ length }) => length >= LEAST_PIECES)
    .slice(0, LABELS_MAX)
    .map((line) => {
      const [x, y] = line.toSorted((a, b) => a[1] - b[1])[Math.floor(line.length / 3)] ?? [0, 0];
      return [x, y];
    });
}

/** The line below a value, and how far it is on to the next, 0 .. 1. */
function between(lines: readonly number[], value: number): [number, number] {
  let low = 0;
  let high = lines.length - 2;
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    if ((lines[middle] ?? 0) <= value) low = middle;
    else high = middle - 1;
  }
  const from = lines[low] ?? 0;
  const share = (value - from) / ((lines[low + 1] ?? from + 1) - from);
  return [low, Math.max(0, Math.min(1, share))];
}
