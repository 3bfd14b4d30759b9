/** Where places of the water lie in the picture of the 3D view, and what a pointer in it means. */
import type { Site } from '../api/types';

/** A place: north, east and down, m. */
export type Ned = readonly [number, number, number];
export interface Pixel {
  x: number;
  y: number;
}

/** Column by column, as WebGL keeps it. */
type Matrix = readonly number[];

/** Horizontal extent of a water in units of the view; `webui/scene/projection.py` says so. */
const VIEW_WIDTH = 10;
/** Nearer to the camera than this nothing is drawn, as a part of its distance to the farthest. */
const NEAR_W = 1e-3;

/** What of viser's client the page looks at: its camera, and the frame that everything lies in. */
interface Viser {
  camera: {
    matrixWorldInverse: { elements: Matrix };
    projectionMatrix: { elements: Matrix };
  } | null;
  nodeRefFromName: Record<string, { matrixWorld: { elements: Matrix } } | null | undefined>;
}

/** The numbers by which the view draws now; `null` before its first picture. */
export function viewOf(frame: HTMLIFrameElement): Matrix | null {
  const inside: (Window & { __viserMutable?: Viser }) | null = frame.contentWindow;
  const viser = inside?.__viserMutable;
  const world = viser?.nodeRefFromName['/world']?.matrixWorld.elements;
  if (!viser?.camera || !world) return null;
  const { matrixWorldInverse, projectionMatrix } = viser.camera;
  return multiplied(multiplied(projectionMatrix.elements, matrixWorldInverse.elements), world);
}

/** The camera of a picture. */
export class SceneCamera {
  readonly #shown: Matrix;
  readonly #back: Matrix | null;
  readonly #width: number;
  readonly #height: number;

  /**
   * @param view What `viewOf` returned.
   * @param width Size of the picture, px.
   * @param exaggeration How many times as deep as it is depth is drawn.
   */
  constructor(
    view: Matrix,
    width: number,
    height: number,
    water: Site['water'],
    exaggeration: number,
  ) {
    const wide = Math.max(water.x_max_m - water.x_min_m, water.y_max_m - water.y_min_m);
    const perM = VIEW_WIDTH / wide;
    // From east, north and up in metres to the units of the view.
    const scale = [perM, 0, 0, 0, 0, perM, 0, 0, 0, 0, perM * exaggeration, 0, 0, 0, 0, 1];
    this.#shown = multiplied(view, scale);
    this.#back = inverted(this.#shown);
    this.#width = width;
    this.#height = height;
  }

  /** Where a place is in the picture; `null` for one behind the camera. */
  at([north, east, down]: Ned): Pixel | null {
    const [x = 0, y = 0, , w = 0] = applied(this.#shown, [east, north, -down, 1]);
    if (w < NEAR_W) return null;
    return { x: ((x / w + 1) / 2) * this.#width, y: ((1 - y / w) / 2) * this.#height };
  }

  /** The place at a depth under a pointer; `null` where the pointer is at none. */
  level(at: Pixel, depthM: number): { north: number; east: number } | null {
    const ray = this.#ray(at);
    if (!ray) return null;
    const [from, to] = ray;
    const share = (-depthM - from[2]) / (to[2] - from[2]);
    // Behind the camera, or beyond the horizon.
    if (!(share > 0 && Number.isFinite(share))) return null;
    return { east: between(from[0], to[0], share), north: between(from[1], to[1], share) };
  }

  /**
   * How deep a pointer is above or below a place; `null` where it cannot be told.
   *
   * The depth of where the ray meets the upright plane through the place that faces the camera.
   */
  depth(at: Pixel, north: number, east: number): number | null {
    const ray = this.#ray(at);
    if (!ray) return null;
    const [from, to] = ray;
    const [ahead, aside] = [east - from[0], north - from[1]];
    const far = ahead ** 2 + aside ** 2;
    const along = (to[0] - from[0]) * ahead + (to[1] - from[1]) * aside;
    const share = far / along;
    return share > 0 && Number.isFinite(share) ? -between(from[2], to[2], share) : null;
  }

  /** From the camera to a point under a pixel: east, north and up, m. */
  #ray({ x, y }: Pixel): readonly [Point, Point] | null {
    if (!this.#back) return null;
    const across = (2 * x) / this.#width - 1;
    const up = 1 - (2 * y) / this.#height;
    // The camera is what a picture shows nowhere; half of its depth lies before it in any case.
    return [point(this.#back, [0, 0, 1, 0]), point(this.#back, [across, up, 0.5, 1])];
  }
}

type Point = readonly [number, number, number];

function point(back: Matrix, shown: readonly number[]): Point {
  const [a = 0, b = 0, c = 0, w = 1] = applied(back, shown);
  return [a / w, b / w, c / w];
}

function between(from: number, to: number, share: number): number {
  return from + share * (to - from);
}

function applied(matrix: Matrix, vector: readonly number[]): number[] {
  return [0, 1, 2, 3].map((row) =>
    [0, 1, 2, 3].reduce((sum, i) => sum + (matrix[4 * i + row] ?? 0) * (vector[i] ?? 0), 0),
  );
}

export function multiplied(first: Matrix, second: Matrix): number[] {
  return [0, 1, 2, 3].flatMap((column) => applied(first, second.slice(4 * column, 4 * column + 4)));
}

/** By Gauss and Jordan with the largest pivot; `null` of a matrix that has no inverse. */
export function inverted(matrix: Matrix): number[] | null {
  const rows = [0, 1, 2, 3].map((row) => [
    ...[0, 1, 2, 3].map((column) => matrix[4 * column + row] ?? 0),
    ...[0, 1, 2, 3].map((column) => (column === row ? 1 : 0)),
  ]);
  for (let step = 0; step < 4; step++) {
    const pivot = rows
      .slice(step)
      .reduce((a, b) => (Math.abs(b[step] ?? 0) > Math.abs(a[step] ?? 0) ? b : a));
    const lead = pivot[step] ?? 0;
    if (lead === 0) return null;
    rows[rows.indexOf(pivot)] = rows[step] ?? [];
    const solved = pivot.map((value) => value / lead);
    for (const [i, row] of rows.entries()) {
      const factor = row[step] ?? 0;
      rows[i] = i === step ? solved : row.map((value, k) => value - factor * (solved[k] ?? 0));
    }
  }
  return [0, 1, 2, 3].flatMap((column) => rows.map((row) => row[4 + column] ?? 0));
}
