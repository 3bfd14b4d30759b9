/** Geographic positions in the three notations that pilots use. */

export type PositionFormat = 'degrees' | 'minutes' | 'seconds';

export const POSITION_FORMATS: readonly { key: PositionFormat; title: string }[] = [
  { key: 'degrees', title: 'DD.DDDDD' },
  { key: 'minutes', title: 'DD MM.MMM' },
  { key: 'seconds', title: 'DD MM SS.S' },
];

/** One angle; carries over, so that 60.000 minutes or seconds are never written. */
function angle(degrees: number, width: number, format: PositionFormat): string {
  const size = Math.abs(degrees);
  if (format === 'degrees') return `${size.toFixed(5).padStart(width + 6, '0')}°`;
  if (format === 'minutes') {
    const thousandths = Math.round(size * 60_000);
    const whole = Math.floor(thousandths / 60_000);
    const minutes = (thousandths % 60_000) / 1000;
    return `${String(whole).padStart(width, '0')}° ${minutes.toFixed(3).padStart(6, '0')}′`;
  }
  const tenths = Math.round(size * 36_000);
  const whole = Math.floor(tenths / 36_000);
  const minutes = Math.floor((tenths % 36_000) / 600);
  const seconds = (tenths % 600) / 10;
  return (
    `${String(whole).padStart(width, '0')}° ${String(minutes).padStart(2, '0')}′ ` +
    `${seconds.toFixed(1).padStart(4, '0')}″`
  );
}

export function latitude(degrees: number, format: PositionFormat): string {
  return `${angle(degrees, 2, format)} ${degrees < 0 ? 'S' : 'N'}`;
}

export function longitude(degrees: number, format: PositionFormat): string {
  return `${angle(degrees, 3, format)} ${degrees < 0 ? 'W' : 'E'}`;
}

/** What stands between the numbers of a position. */
const MARKS = /[°º'′’"″”:]/g;
const ONE = /^([NSEW]?)\s*([+-]?[\d.]+)(?:\s+([\d.]+))?(?:\s+([\d.]+))?\s*([NSEW]?)$/;

/**
 * A position as it is typed, in any of the notations, latitude first: `42.76, -84.38`,
 * `42 45.6 N 84 22.8 W`, `42° 45′ 36″ N, 084° 22′ 48″ W`. `null` if it is none.
 */
export function parsePosition(text: string): { latitude: number; longitude: number } | null {
  const plain = text
    .toUpperCase()
    .replaceAll(MARKS, ' ')
    .replaceAll('\u2212', '-')
    .trim()
    .replaceAll(/\s+/g, ' ');
  const halves = plain.includes(',')
    ? plain.split(',')
    : (/^(.*?[NS])\s*(.*[EW])$/.exec(plain)?.slice(1) ??
      /^(\S+) (\S+)$/.exec(plain)?.slice(1) ??
      []);
  const [north, east] = halves.map((half) => half.trim());
  const latitude = parseAngle(north ?? '', 'NS', 90);
  const longitude = parseAngle(east ?? '', 'EW', 180);
  return latitude === null || longitude === null ? null : { latitude, longitude };
}

function parseAngle(text: string, letters: string, most: number): number | null {
  const found = ONE.exec(text);
  if (!found) return null;
  const letter = found[1] ?? '';
  const behind = found[5] ?? '';
  const side = letter || behind;
  if ((letter && behind) || (side && !letters.includes(side))) return null;
  const parts = [found[2], found[3], found[4]].filter(Boolean);
  const numbers = parts.map(Number);
  const [whole = NaN, minutes = 0, seconds = 0] = numbers;
  const isWhole = (value: number, i: number) => i === numbers.length - 1 || Number.isInteger(value);
  if (!numbers.every(Number.isFinite) || !numbers.every(isWhole)) return null;
  if (minutes >= 60 || seconds >= 60 || (side && whole < 0)) return null;
  const size = Math.abs(whole) + minutes / 60 + seconds / 3600;
  const isNegative = (parts[0] ?? '').startsWith('-') || side === 'S' || side === 'W';
  if (size > most) return null;
  return isNegative ? -size : size;
}
