import { afterEach, beforeEach, describe, expect, test, vi } from 'vitest';
import { Preference } from './preference.svelte';

describe('the theme', () => {
  const page = { documentElement: { dataset: {} as Record<string, string> } };
  beforeEach(() => {
    vi.stubGlobal('document', page);
    vi.stubGlobal('localStorage', { getItem: () => null, setItem: vi.fn() });
  });
  afterEach(() => vi.unstubAllGlobals());

  test('is worn by the page before a chart hears of it and reads its colours', () => {
    const preference = new Preference();
    expect(page.documentElement.dataset.theme).toBe('dark');
    preference.theme = 'night-red';
    expect(page.documentElement.dataset.theme).toBe('night-red');
    expect(preference.theme).toBe('night-red');
  });

  test('and the view that was chosen last are found again', () => {
    const kept = { theme: 'day', view: 'above' };
    vi.stubGlobal('localStorage', { getItem: () => JSON.stringify(kept), setItem: vi.fn() });
    const { theme, view } = new Preference();
    expect([theme, view]).toEqual(['day', 'above']);
  });
});
