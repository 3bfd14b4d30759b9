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
