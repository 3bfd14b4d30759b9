import { expect, test } from 'vitest';
import { readUtc, stretchFault, writeUtc } from './stretch';

test('a stretch of the journal is typed in UTC', () => {
  expect(readUtc('2026-11-21 14:32:05')).toBe(Date.UTC(2026, 10, 21, 14, 32, 5));
  expect(readUtc('2026-11-21T14:32Z')).toBe(Date.UTC(2026, 10, 21, 14, 32));
  expect(readUtc('21.11.2026')).toBeNull();
  expect(readUtc('2026-13-41 14:32')).toBeNull();
  expect(writeUtc(Date.UTC(2026, 10, 21, 14, 32, 5))).toBe('2026-11-21 14:32:05');
  expect(stretchFault('2026-11-21 14:00', '2026-11-21 15:00')).toBe('');
  expect(stretchFault('2026-11-21 15:00', '2026-11-21 15:00')).not.toBe('');
  expect(stretchFault('', '2026-11-21 15:00')).not.toBe('');
});
