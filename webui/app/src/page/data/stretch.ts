/** What is wrong with a stretch of time as typed in UTC; empty if nothing is. */
export function stretchFault(start: string, end: string): string {
  const [from, to] = [Date.parse(`${start}Z`), Date.parse(`${end}Z`)];
  if (Number.isNaN(from) || Number.isNaN(to)) return 'Give both ends of the stretch.';
  return from < to ? '' : 'It must begin before it ends.';
}
