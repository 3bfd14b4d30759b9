/** Amounts of stored data in words. */

const UNITS = ['B', 'kB', 'MB', 'GB', 'TB'] as const;

/** Bytes with three digits that count: `1.25 GB`. */
export function bytesText(bytes: number): string {
  let value = bytes;
  let unit = 0;
  while (Math.abs(value) >= 999.5 && unit < UNITS.length - 1) {
    value /= 1000;
    unit += 1;
  }
  const digits = unit === 0 || Math.abs(value) >= 99.95 ? 0 : Math.abs(value) >= 9.995 ? 1 : 2;
  return `${value.toFixed(digits)} ${UNITS[unit]}`;
}

/** Rows with thousands apart; large ones rounded, for they are counted now and then. */
export function rowsText(rows: number): string {
  if (rows >= 1e8) return `${(rows / 1e6).toFixed(0)} million`;
  if (rows >= 1e6) return `${(rows / 1e6).toFixed(1)} million`;
  return Math.round(rows).toLocaleString('en-US').replaceAll(',', '\u202f');
}

/** How long a number of days is, in the unit that a person would say. */
export function daysText(days: number): string {
  if (days < 1) return 'less than a day';
  if (days < 60) return `about ${Math.round(days)} ${Math.round(days) === 1 ? 'day' : 'days'}`;
  if (days < 730) return `about ${Math.round(days / 30.4)} months`;
  if (days < 36_500) return `about ${Math.round(days / 365)} years`;
  return 'more than a century';
}
