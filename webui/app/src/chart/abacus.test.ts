import { expect, test } from 'vitest';
import type { Tag } from '../api/types';
import { abacus } from './abacus';

const tag = (name: string, hours: number[], doubts: boolean[]): Tag => ({
  tag: name,
  name: null,
  detections: hours.length,
  doubtful: doubts.filter(Boolean).length,
  first_at: '2026-07-01T09:00:00Z',
  last_at: new Date(
    Date.parse('2026-07-01T09:00:00Z') + 3_600_000 * (hours.at(-1) ?? 0),
  ).toISOString(),
  hours,
  doubts,
});

test('detections stand between the edges by their times', () => {
  const plot = abacus([tag('a', [0, 2], [false, true]), tag('b', [1], [true])], 100, 300);
  expect(plot.rows[0]?.dots.map(({ x }) => x)).toEqual([100, 300]);
  expect(plot.rows[1]?.dots).toMatchObject([{ x: 200, isDoubtful: true }]);
});

test('ticks are few and at whole steps', () => {
  const plot = abacus([tag('a', [0, 30], [false, false])], 0, 500);
  expect(plot.ticks.length).toBeLessThanOrEqual(6);
  expect(plot.ticks.every(({ at }) => at % 3_600_000 === 0)).toBe(true);
});

test('a single detection and none at all are drawn too', () => {
  expect(abacus([tag('a', [0], [true])], 0, 100).rows[0]?.dots).toHaveLength(1);
  expect(abacus([], 0, 100).rows).toEqual([]);
});
