import { beforeEach, describe, expect, it, vi } from 'vitest';
import { ContinueWish } from './continue_wish.svelte';

describe('whether a survey continues by itself', () => {
  let storage: Map<string, string>;

  beforeEach(() => {
    storage = new Map();
    vi.stubGlobal('sessionStorage', {
      getItem: (key: string) => storage.get(key) ?? null,
      setItem: (key: string, value: string) => storage.set(key, value),
    });
  });

  it('does until somebody says no', () => {
    expect(new ContinueWish().of('mini-1')).toBe(true);
  });

  it('remembers a no when the page is opened again, of that robot alone', () => {
    new ContinueWish().say('mini-1', false);
    const again = new ContinueWish();
    expect(again.of('mini-1')).toBe(false);
    expect(again.of('grace-3')).toBe(true);
  });

  it('takes nothing from what it did not write', () => {
    for (const damaged of ['{', 'null', '[1]', '{"mini-1": "no"}']) {
      storage.set('grace continue by itself', damaged);
      expect(new ContinueWish().of('mini-1')).toBe(true);
    }
  });
});
