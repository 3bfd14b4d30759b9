/** Units of the screen: what a stored SI value is multiplied by to be shown. */
export interface ScreenUnit {
  /** What stands behind the number. */
  label: string;
  /** Screen value = SI value x factor. */
  factor: number;
}

const FACTORS: Record<string, Record<string, number>> = {
  rad: { deg: 180 / Math.PI },
  'rad/s': { 'deg/s': 180 / Math.PI },
  s: { min: 1 / 60, h: 1 / 3600, d: 1 / 86400, ms: 1000 },
  m: { cm: 100, mm: 1000, km: 1 / 1000 },
  'm/s': { 'cm/s': 100, 'mm/s': 1000, 'km/h': 3.6 },
  kg: { g: 1000 },
  Hz: { kHz: 1 / 1000 },
  '': { '%': 100, units: 1 },
  '1': { '%': 100 },
};

const LABELS: Record<string, string> = {
  deg: '°',
  'deg/s': '°/s',
  degC: '°C',
  '1': '',
  '1e-9': 'ppb',
  'm/s^0.5': 'm/√s',
};

const RAISED: Record<string, string> = { '-': '⁻', '1': '¹', '2': '²', '3': '³', '4': '⁴' };

/** `kg m2/s^3` as it is written: raised digits, dots between factors. */
function unitLabel(unit: string): string {
  return (
    LABELS[unit] ??
    unit
      .replaceAll(/\bu(?=(?:mol|g|m|l|L|S|V|A|Pa|s)\b)/g, 'µ')
      .replaceAll(/([A-Za-z])\^?(-?[1234])(?![\d.])/g, (_, letter: string, power: string) => {
        return letter + Array.from(power, (sign) => RAISED[sign] ?? sign).join('');
      })
      .replaceAll(/[ *]+/g, '·')
  );
}

/** How a value in `unit` is shown; an unknown pair keeps the stored unit, never a wrong one. */
export function screenUnit(unit: string, displayUnit?: string | null): ScreenUnit {
  const factor = displayUnit ? FACTORS[unit]?.[displayUnit] : undefined;
  const shown = factor === undefined || !displayUnit ? unit : displayUnit;
  return { label: unitLabel(shown), factor: factor ?? 1 };
}

/** A number as a person types it: no float noise, no exponent where it can be avoided. */
export function plainNumber(value: number, digits = 6): string {
  if (!Number.isFinite(value)) return '';
  const rounded = Number(value.toPrecision(digits));
  const size = Math.abs(rounded);
  if (size !== 0 && (size < 1e-5 || size >= 1e9)) return String(rounded);
  return rounded.toLocaleString('en-US', { useGrouping: false, maximumFractionDigits: 12 });
}

/** Minus sign of full width, so that signed numbers align. */
export function fixed(value: number, decimals: number): string {
  const text = value.toFixed(decimals);
  return Number(text) === 0 ? (0).toFixed(decimals) : text.replace('-', '\u2212');
}

/** Lengths of one thing in one unit: "4.6 × 3.1 m", or kilometres once the longest asks for it. */
export function lengths(metres: readonly number[]): string {
  const isFar = Math.max(...metres) >= 5000;
  const shown = metres.map((length) => plainNumber(isFar ? length / 1000 : length, 3));
  return `${shown.join(' × ')} ${isFar ? 'km' : 'm'}`;
}

/** A number with about three significant digits. */
export function compact(value: number | null | undefined, digits = 3): string {
  if (value === null || value === undefined || !Number.isFinite(value)) return '–';
  if (value === 0) return '0';
  const size = Math.abs(value);
  if (size >= 1e6 || size < 1e-4) return value.toExponential(digits - 1).replace('-', '\u2212');
  const decimals = Math.max(0, digits - 1 - Math.floor(Math.log10(size)));
  return fixed(value, Math.min(decimals, 6));
}

/** `×1.65`: what a deviation of a natural logarithm means for the quantity itself. */
export function factorText(deviation: number): string {
  return `×${compact(Math.exp(deviation), 3)}`;
}

/** Energy units of the planner's account. */
export function energy(value: number): string {
  return value < 0.05 ? '0' : fixed(value, value < 9.95 ? 1 : value % 1 === 0 ? 0 : 1);
}

/** About what energy units are in watt-hours; "" where nobody knows. */
export function wattHours(value: number | null | undefined): string {
  return typeof value === 'number' ? `about ${compact(value, 2)} Wh` : '';
}

/** Signal strength as a radio reports it. */
export function signal(dbm: number | null): string {
  return dbm === null ? '–' : `${fixed(dbm, 0)} dBm`;
}

export function bytes(value: number): string {
  return value < 10_000 ? `${value} B` : `${(value / 1000).toFixed(1)} kB`;
}
