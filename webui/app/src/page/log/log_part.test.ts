import { beforeEach, describe, expect, it } from 'vitest';
import type { LogItem } from '../../api/types';
import { EntryDraft } from './entry_draft.svelte';
import { folded, joined } from './log_part';

function event(key: number, level = 'info'): LogItem {
  return {
    at: '2026-11-21T04:23:48Z',
    place: `${key}.0.${key}`,
    group: 'dives',
    entry: null,
    event: { cursor: key, level },
  } as unknown as LogItem;
}

function entry(key: number): LogItem {
  return {
    ...event(key),
    place: `${key}.1.${key}`,
    event: null,
    entry: { id: `entry-${key}` },
  } as never;
}

describe('lines of the log book', () => {
  it('has each line once, where two readings overlap', () => {
    const places = joined([event(5), event(4)], [event(4), event(3)]).map(({ place }) => place);
    expect(places).toEqual(['5.0.5', '4.0.4', '3.0.3']);
  });

  it('folds what happened between entries, but for what is grave', () => {
    const items = [event(9), event(8), entry(7), event(6), event(5, 'critical'), event(4)];
    expect(folded(items).map((line) => line.length)).toEqual([2, 1, 1, 1, 1]);
  });
});

describe('a draft of an entry', () => {
  const kept = new Map<string, string>();
  beforeEach(() => {
    kept.clear();
    const storage = {
      getItem: (key: string) => kept.get(key) ?? null,
      setItem: (key: string, value: string) => kept.set(key, value),
      removeItem: (key: string) => kept.delete(key),
    };
    Object.defineProperty(globalThis, 'localStorage', { value: storage, configurable: true });
  });

  it('outlives a reload of the page, until it is sent', () => {
    const draft = new EntryDraft('new-', { robot: 'mini-1' });
    draft.set({ text: 'It leaks', tags: 'hull, leak,' });
    const again = new EntryDraft('new-');
    expect([again.kept.text, again.kept.robot, again.tags]).toEqual([
      'It leaks',
      'mini-1',
      ['hull', 'leak'],
    ]);
    again.clear();
    expect(new EntryDraft('new-').isEmpty).toBe(true);
  });

  it('is empty where something else was kept', () => {
    kept.set('grace.log.draft.new-', '{"text": 5}');
    expect(new EntryDraft('new-').isEmpty).toBe(true);
  });
});
