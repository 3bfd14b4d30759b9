/** What a cell is marked with besides its colour, so that it is told apart without colour. */
export type CellMark = 'hatched' | 'dotted' | null;

/** Marked cells beside one another in a row. */
export interface MarkedRun {
  mark: Exclude<CellMark, null>;
  row: number;
  from: number;
  /** First column that is not part of it. */
  to: number;
}

export function runsOf(marks: readonly CellMark[], columns: number): MarkedRun[] {
  const runs: MarkedRun[] = [];
  marks.forEach((mark, i) => {
    if (mark === null) return;
    const row = Math.floor(i / columns);
    const column = i % columns;
    const last = runs.at(-1);
    if (last?.row === row && last.to === column && last.mark === mark) last.to++;
    else runs.push({ mark, row, from: column, to: column + 1 });
  });
  return runs;
}

/** Cell at a share of the picture's width and height. */
export function nearestCell(
  across: number,
  down: number,
  columns: number,
  rows: number,
): { column: number; row: number } | null {
  const column = Math.floor(across * columns);
  const row = Math.floor(down * rows);
  return column >= 0 && row >= 0 && column < columns && row < rows ? { column, row } : null;
}
