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

const MINUTE_MS = 60_000;
const DAY_MS = 86_400_000;

/**
 * A moment as a person types it, UTC: `2026-11-21 14:32`, also with `T`, seconds or `Z`.
 *
 * A time alone, `14:32`, is the next one after now, or where `isOfDay` that of the same day. `null` for what is none, such as 25:00.
 */
export function parseUtc(text: string, now: number, isOfDay = false): number | null {
  const found =
    /^(?:(\d{4}-\d{2}-\d{2})(?:[ T]+|$))?(?:(\d{1,2}):(\d{2})(?::(\d{2}))?\s*[zZ]?)$/.exec(
      text.trim(),
    );
  if (!found) return null;
  const [, day, hour = '', minute = '', second = '0'] = found;
  if (Number(hour) > 23 || Number(minute) > 59 || Number(second) > 59) return null;
  const midnight = Date.parse(`${day ?? clockDate(now)}T00:00:00Z`);
  if (Number.isNaN(midnight) || (day !== undefined && clockDate(midnight) !== day)) return null;
  const at = midnight + (Number(hour) * 60 + Number(minute)) * MINUTE_MS + Number(second) * 1000;
  return day === undefined && !isOfDay && at <= now ? at + DAY_MS : at;
}

/** 2026-11-21 14:32, as it is typed: seconds only where there are some. */
export function typedUtc(at: number | string): string {
  const ms = new Date(at).getTime();
  if (Number.isNaN(ms)) return '';
  return dateTime(ms).slice(0, ms % MINUTE_MS === 0 ? 16 : 19);
}

/**
 * Age of a value; steps of a second, so that it does not flicker.
 *
 * @param than What it is older than: now, or the cursor of a replay.
 */
export function age(seconds: number | null, than = 'ago'): string {
  if (seconds === null || !Number.isFinite(seconds)) return 'never heard';
  return `${lapse(seconds)} ${than}`;
}

function lapse(seconds: number): string {
  if (seconds < 1) return '<1 s';
  if (seconds < 60) return `${Math.floor(seconds)} s`;
  if (seconds < 3600) return `${Math.floor(seconds / 60)} min`;
  if (seconds < 86400) return `${Math.floor(seconds / 3600)} h`;
  const days = Math.floor(seconds / 86400);
  if (days < 60) return `${days} d`;
  return days < 730 ? `${Math.floor(days / 30.44)} months` : `${Math.floor(days / 365.25)} years`;
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
