/** Times of the screen: UTC with a Z, ages and durations in words. */

function two(value: number): string {
  return String(Math.trunc(value)).padStart(2, '0');
}

/** A moment as the station takes it. */
export function rfc3339(ms: number): string {
  return new Date(ms).toISOString();
}

/** 14:32:05Z */
export function clockTime(at: number | string | null, seconds = true): string {
  if (at === null) return '–';
  const date = new Date(at);
  if (Number.isNaN(date.getTime())) return '–';
  const minutes = `${two(date.getUTCHours())}:${two(date.getUTCMinutes())}`;
  return seconds ? `${minutes}:${two(date.getUTCSeconds())}Z` : `${minutes}Z`;
}

/** 2026-11-21 */
export function clockDate(at: number | string): string {
  const date = new Date(at);
  return Number.isNaN(date.getTime()) ? '–' : date.toISOString().slice(0, 10);
}

/** 2026-11-21 14:32:05Z */
export function dateTime(at: number | string | null): string {
  return at === null ? '–' : `${clockDate(at)} ${clockTime(at)}`;
}

/** Age of a value; steps of a second, so that it does not flicker. */
export function age(seconds: number | null): string {
  if (seconds === null || !Number.isFinite(seconds)) return 'never heard';
  if (seconds < 1) return '<1 s ago';
  if (seconds < 60) return `${Math.floor(seconds)} s ago`;
  if (seconds < 3600) return `${Math.floor(seconds / 60)} min ago`;
  if (seconds < 86400) return `${Math.floor(seconds / 3600)} h ago`;
  const days = Math.floor(seconds / 86400);
  if (days < 60) return `${days} d ago`;
  return days < 730
    ? `${Math.floor(days / 30.44)} months ago`
    : `${Math.floor(days / 365.25)} years ago`;
}

/** 45 s, 12 min 05 s, 3 h 20 min */
export function duration(seconds: number | null | undefined): string {
  if (seconds === null || seconds === undefined || !Number.isFinite(seconds)) return '–';
  const whole = Math.round(seconds);
  if (whole < 60) return `${whole} s`;
  if (whole < 3600) return `${Math.floor(whole / 60)} min ${two(whole % 60)} s`;
  const minutes = Math.round(whole / 60);
  return `${Math.floor(minutes / 60)} h ${two(minutes % 60)} min`;
}

/** Time to an expected event: "in 2 min 10 s", or how long it is overdue. */
export function countdown(seconds: number): string {
  return seconds >= 0 ? `in ${duration(seconds)}` : `overdue by ${duration(-seconds)}`;
}

/** Time to something that comes about then and is not late at once: "in 4 min 10 s", "due now". */
export function about(seconds: number, patience = 120): string {
  return seconds < 0 && seconds > -patience ? 'due now' : countdown(seconds);
}
