import type { Series } from './series';

/** How a flagged value is marked: by colour and by shape. */
export type FlagMark = 'suspect' | 'bad';

export interface FlagLook {
  title: string;
  /** Outline about the origin, px. */
  d: string;
  /** Name of the colour token. */
  colour: string;
  isFilled: boolean;
}

export const FLAG_MARKS: Readonly<Record<FlagMark, FlagLook>> = {
  suspect: { title: 'Suspect', d: 'm0-4l4 4l-4 4l-4-4z', colour: '--watch', isFilled: true },
  bad: { title: 'Bad', d: 'm-3.5-3.5l7 7m0-7l-7 7', colour: '--alarm', isFilled: false },
};

/** The mark of a flag of OG1.0; `null` of what is good, or was not evaluated. */
export function markOf(flag: number): FlagMark | null {
  if (flag >= 4) return 'bad';
  return flag === 3 ? 'suspect' : null;
}

/**
 * The flagged values of a series: one column for each mark that there is, empty elsewhere.
 *
 * @param flag Of the values of the series, whose gaps have none.
 */
export function flagColumns(
  { v }: Series,
  flag: readonly number[],
): [mark: FlagMark, column: (number | null)[]][] {
  const marks: (FlagMark | null)[] = [];
  let given = 0;
  for (const value of v) marks.push(value === null ? null : markOf(flag[given++] ?? 0));
  return (['suspect', 'bad'] as const)
    .filter((mark) => marks.includes(mark))
    .map((mark) => [mark, v.map((value, i) => (marks[i] === mark ? value : null))]);
}
