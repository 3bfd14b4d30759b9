import { describe, expect, test } from 'vitest';
import { leastWords, NIGHT, stateWords, withDay, WORKING_DAY } from './notice';

describe('the words of notices', () => {
  test('never take a service for a reader', () => {
    expect(stateWords('handed', 1, 0)).toBe('A service took it');
    expect(stateWords('queued', 0, 0)).toBe('Waits');
    expect(stateWords('queued', 3, 0)).toBe('Tried 3 ×, is tried again');
    expect(stateWords('handed', 2, 1)).toBe('A service took it; it may have come twice');
    expect(stateWords('given_up', 9, 2)).toBe('Given up; it may have come all the same');
  });

  test('say from which level on', () => {
    expect(leastWords('warning')).toBe('Warning and graver');
    expect(leastWords('critical')).toBe('Critical');
    expect(leastWords('none')).toBe('Never');
  });
});

describe('hours', () => {
  test('gain and lose days, in their order', () => {
    expect(withDay(WORKING_DAY, 6, true).days).toEqual([0, 1, 2, 3, 4, 6]);
    expect(withDay(NIGHT, 0, false).days).toEqual([1, 2, 3, 4, 5, 6]);
    expect(withDay(WORKING_DAY, 0, true).days).toEqual(WORKING_DAY.days);
  });
});
