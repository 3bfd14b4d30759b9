import { describe, expect, test } from 'vitest';
import type { Parameter } from '../../api/types';
import { faultOf, fitting, isKept, valueText } from './parameter';

const REAL: Parameter = {
  name: 'CTRL_K_PITCH',
  title: '',
  help: '',
  unit: '',
  default: null,
  minimum: null,
  maximum: null,
  values: [],
  needs_reboot: false,
  is_default: null,
  other: null,
  value: 1.4,
  type: 'real32',
  is_integer: false,
  pending: false,
  read_at: '',
};
const WHOLE: Parameter = { ...REAL, name: 'CTRL_KIND', value: 2, type: 'uint8', is_integer: true };

describe('a parameter', () => {
  test('is found by parts of its name', () => {
    expect(fitting([REAL, WHOLE], 'ctrl kind').map(({ name }) => name)).toEqual(['CTRL_KIND']);
    expect(fitting([REAL, WHOLE], '')).toHaveLength(2);
  });

  test('is shown without the noise of its 32 bits', () => {
    expect(valueText({ ...REAL, value: Math.fround(0.82) })).toBe('0.82');
    expect(valueText(WHOLE)).toBe('2');
  });

  test('takes only what it can hold', () => {
    expect(faultOf(REAL, '')).not.toBe('');
    expect(faultOf(REAL, '1.5')).toBe('');
    expect(faultOf(REAL, '1e39')).not.toBe('');
    expect(faultOf(WHOLE, '1.5')).toBe('Type a whole number.');
    expect(faultOf(WHOLE, '256')).toBe('From 0 to 255.');
    expect(faultOf(WHOLE, '255')).toBe('');
  });

  test('is proved when the robot has what was asked for, to its own precision', () => {
    expect(isKept(0.1, { ...REAL, value: Math.fround(0.1) })).toBe(true);
    expect(isKept(0.1, { ...REAL, value: 0.6 })).toBe(false);
    expect(isKept(3, { ...WHOLE, value: 2 })).toBe(false);
  });
});
