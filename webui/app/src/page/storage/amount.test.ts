import { describe, expect, it } from 'vitest';
import { bytesText, daysText, rowsText } from './amount';

describe('amounts of stored data', () => {
  it('tells bytes by three digits that count', () => {
    expect(bytesText(0)).toBe('0 B');
    expect(bytesText(999)).toBe('999 B');
    expect(bytesText(1250)).toBe('1.25 kB');
    expect(bytesText(999_600)).toBe('1.00 MB');
    expect(bytesText(123_456_789)).toBe('123 MB');
    expect(bytesText(4.2e15)).toBe('4200 TB');
  });

  it('rounds large counts, which are made now and then', () => {
    expect(rowsText(1234)).toBe('1\u202f234');
    expect(rowsText(3_440_000)).toBe('3.4 million');
    expect(rowsText(123_400_000)).toBe('123 million');
  });

  it('tells times in the unit that a person would say', () => {
    expect(daysText(0.4)).toBe('less than a day');
    expect(daysText(1.2)).toBe('about 1 day');
    expect(daysText(45)).toBe('about 45 days');
    expect(daysText(200)).toBe('about 7 months');
    expect(daysText(1500)).toBe('about 4 years');
    expect(daysText(1e6)).toBe('more than a century');
  });
});
