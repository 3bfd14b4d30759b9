const WRITTEN = /^(\d{4}-\d\d-\d\d)[ T](\d\d:\d\d)(:\d\d)?Z?$/;

/** A moment as typed in UTC, such as `2026-11-21 14:32:05`; `null` if it is none. */
export function readUtc(typed: string): number | null {
  const found = WRITTEN.exec(typed.trim());
  if (found === null) return null;
  const [, date = '', minutes = '', seconds = ':00'] = found;
  const ms = Date.parse(`${date}T${minutes}${seconds}Z`);
  return Number.isNaN(ms) ? null : ms;
}

/** The same the other way round. */
export function writeUtc(ms: number): string {
  return new Date(ms).toISOString().slice(0, 19).replace('T', ' ');
}

/** What is wrong with a stretch of time as typed in UTC; empty if nothing is. */
export function stretchFault(start: string, end: string): string {
  const [from, to] = [readUtc(start), readUtc(end)];
  if (from === null || to === null) return 'Write both ends like 2026-11-21 14:32:05.';
  return from < to ? '' : 'It must begin before it ends.';
}
