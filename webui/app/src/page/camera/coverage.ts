export type Point = readonly [x: number, y: number];

/** The least convex outline around points, by Andrew's monotone chain; counter-clockwise. */
export function outline(points: readonly Point[]): Point[] {
  const sorted = [...points].sort((a, b) => a[0] - b[0] || a[1] - b[1]);
  if (sorted.length < 3) return sorted;
  const half = (way: readonly Point[]): Point[] => {
    const chain: Point[] = [];
    for (const point of way) {
      while (chain.length >= 2 && !turnsLeft(chain.at(-2), chain.at(-1), point)) chain.pop();
      chain.push(point);
    }
    return chain.slice(0, -1);
  };
  return [...half(sorted), ...half(sorted.reverse())];
}

function turnsLeft(a: Point | undefined, b: Point | undefined, c: Point): boolean {
  if (!a || !b) return true;
  return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]) > 0;
}

/** How many parts of a picture no corner of the board has been in. */
export function emptyCells(cells: readonly (readonly number[])[]): number {
  return cells.flat().filter((count) => count === 0).length;
}
