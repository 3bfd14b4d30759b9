/** Lines of equal value through a grid, by marching squares. */

/** A piece of a line in cells: the centre of the first cell is (0, 0), columns first. */
export type Piece = readonly [x0: number, y0: number, x1: number, y1: number];

/** Pieces of the line where a row-by-row grid crosses `level`; squares with a hole are left out. */
export function contour(
  values: Float64Array,
  width: number,
  height: number,
  level: number,
): Piece[] {
  const pieces: Piece[] = [];
  for (let row = 0; row + 1 < height; row++) {
    for (let column = 0; column + 1 < width; column++) {
      const at = row * width + column;
      // Corners clockwise from the top left, and where each stands in the square.
      const corners = [values[at], values[at + 1], values[at + width + 1], values[at + width]];
      if (corners.every((value) => value !== undefined && Number.isFinite(value))) {
        pieces.push(...squarePieces(corners as number[], level, column, row));
      }
    }
  }
  return pieces;
}

const CORNERS = [
  [0, 0],
  [1, 0],
  [1, 1],
  [0, 1],
] as const;

function squarePieces(corners: number[], level: number, column: number, row: number): Piece[] {
  const crossings: [number, number][] = [];
  CORNERS.forEach(([x0, y0], i) => {
    const [x1, y1] = CORNERS[(i + 1) % 4] ?? [0, 0];
    const from = corners[i] ?? 0;
    const to = corners[(i + 1) % 4] ?? 0;
    if (from > level === to > level) return;
    const share = (level - from) / (to - from);
    crossings.push([column + x0 + (x1 - x0) * share, row + y0 + (y1 - y0) * share]);
  });
  const [a, b, c, d] = crossings;
  if (!a || !b) return [];
  if (!c || !d) return [[...a, ...b]];
  // A saddle: the value in the middle tells which corners belong together.
  const middle = corners.reduce((sum, value) => sum + value, 0) / 4;
  const isJoined = (corners[0] ?? 0) > level === middle > level;
  return isJoined
    ? [
        [...a, ...b],
        [...c, ...d],
      ]
    : [
        [...a, ...d],
        [...b, ...c],
      ];
}

/** Pieces that meet end to end, each line by itself, the longest first. */
export function joined(pieces: readonly Piece[]): Piece[][] {
  const keyOf = (x: number, y: number) => `${x.toFixed(6)} ${y.toFixed(6)}`;
  const byEnd = new Map<string, number[]>();
  pieces.forEach(([x0, y0, x1, y1], i) => {
    for (const key of [keyOf(x0, y0), keyOf(x1, y1)]) {
      byEnd.set(key, [...(byEnd.get(key) ?? []), i]);
    }
  });
  const seen = new Set<number>();
  const lines = pieces.map((_, first) => {
    const line: Piece[] = [];
    const waiting = [first];
    for (let i = waiting.pop(); i !== undefined; i = waiting.pop()) {
      const piece = pieces[i];
      if (!piece || seen.has(i)) continue;
      seen.add(i);
      line.push(piece);
      const [x0, y0, x1, y1] = piece;
      waiting.push(...(byEnd.get(keyOf(x0, y0)) ?? []), ...(byEnd.get(keyOf(x1, y1)) ?? []));
    }
    return line;
  });
  return lines.filter(({ length }) => length > 0).toSorted((a, b) => b.length - a.length);
}

/** One drawable path of all pieces, in the units of `toX` and `toY`. */
export function contourPath(
  pieces: readonly Piece[],
  toX: (column: number) => number,
  toY: (row: number) => number,
): string {
  const point = (x: number, y: number) => `${toX(x).toFixed(1)} ${toY(y).toFixed(1)}`;
  return pieces.map(([x0, y0, x1, y1]) => `M${point(x0, y0)}L${point(x1, y1)}`).join('');
}
