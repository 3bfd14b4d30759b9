import type { Parameter } from '../../api/types';
import { plainNumber } from '../../text/unit';

/** Parameters with every word of the filter in their names, by name. */
export function fitting(parameters: readonly Parameter[], filter: string): Parameter[] {
  const wanted = filter.toLowerCase().split(/\s+/).filter(Boolean);
  return parameters
    .filter(({ name }) => wanted.every((word) => name.toLowerCase().includes(word)))
    .toSorted((a, b) => a.name.localeCompare(b.name));
}

/** Whether a parameter has not its default, or not what the robot beside has. */
export function isDiffering({ is_default: isDefault, other, value }: Parameter): boolean {
  return isDefault === false || (other !== null && other !== value);
}

export function valueText({ value, is_integer: isInteger }: Parameter): string {
  return isInteger ? String(value) : plainNumber(value, 7);
}

const INTEGERS: Record<string, readonly [number, number]> = {
  uint8: [0, 0xff],
  int8: [-0x80, 0x7f],
  uint16: [0, 0xffff],
  int16: [-0x8000, 0x7fff],
  uint32: [0, 0xffffffff],
  int32: [-0x80000000, 0x7fffffff],
};

/** What is wrong with a typed value; empty if nothing is. */
export function faultOf({ is_integer: isInteger, type }: Parameter, typed: string): string {
  const value = Number(typed);
  if (typed.trim() === '' || !Number.isFinite(value)) return 'Type a number.';
  if (!isInteger) return Math.abs(value) > 3.4e38 ? 'Too large for this parameter.' : '';
  if (!Number.isInteger(value)) return 'Type a whole number.';
  const limits = INTEGERS[type.toLowerCase()];
  if (limits && (value < limits[0] || value > limits[1])) {
    return `From ${limits[0]} to ${limits[1]}.`;
  }
  return '';
}

/** Whether what was read back is what was asked for, as exactly as the robot can keep it. */
export function isKept(asked: number, proved: Parameter): boolean {
  return proved.is_integer
    ? proved.value === asked
    : Math.fround(proved.value) === Math.fround(asked);
}
