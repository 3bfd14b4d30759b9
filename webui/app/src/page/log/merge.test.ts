import { expect, test } from 'vitest';
import type { StationEvent } from '../../api/types';
import { isSought, mergeEvents } from './merge';

const event = (cursor: number, text: string, by: string | null = null) =>
  ({ cursor, text, by, kind: 'plan.draft' }) as StationEvent;

test('two stretches become one, in order, each event once', () => {
  const merged = mergeEvents([event(1, 'a'), event(3, 'c')], [event(2, 'b'), event(3, 'c')]);
  expect(merged.map((one) => one.cursor)).toEqual([1, 2, 3]);
});

test('an event is sought by its words, its kind and who caused it', () => {
  const one = event(1, 'Ann sent plan-3.', 'ann');
  expect(isSought(one, '', '')).toBe(true);
  expect(isSought(one, '', 'SENT')).toBe(true);
  expect(isSought(one, '', 'plan.dr')).toBe(true);
  expect(isSought(one, '', 'surface')).toBe(false);
  expect(isSought(one, 'ann', 'sent')).toBe(true);
  expect(isSought(one, 'ben', '')).toBe(false);
});
