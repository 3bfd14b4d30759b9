import { afterEach, describe, expect, test, vi } from 'vitest';
import { badgeRoles, badgeText } from './badge';
import { LastContact } from './last_contact';

describe('the badge', () => {
  test('counts what nobody has acknowledged, as far as it is known', () => {
    expect(badgeText({ count: 0, kind: null })).toBe('');
    expect(badgeText({ count: 7, kind: 'warning' })).toBe('7');
    expect(badgeText({ count: 100, kind: 'warning' })).toBe('99+');
    expect(badgeText({ count: null, kind: 'critical' })).toBe('?');
  });

  test('has the colour of the gravest, and none while the station is not heard', () => {
    expect(badgeRoles({ count: 1, kind: 'critical' })[0]).toBe('--alarm-fill');
    expect(badgeRoles({ count: 1, kind: 'watch' })[0]).toBe('--watch');
    expect(badgeRoles({ count: 1, kind: null })[0]).toBe('--line-strong');
    expect(badgeRoles({ count: null, kind: 'critical' })[0]).toBe('--line-strong');
  });
});

describe('the last contact', () => {
  const kept = new Map<string, string>();
  vi.stubGlobal('localStorage', {
    getItem: (key: string) => kept.get(key) ?? null,
    setItem: (key: string, value: string) => kept.set(key, value),
  });
  afterEach(() => kept.clear());

  test('is kept at most every five seconds', () => {
    const contact = new LastContact();
    contact.note(100_000);
    contact.note(104_000);
    expect(LastContact.kept()).toBe(100_000);
    contact.note(105_000);
    expect(LastContact.kept()).toBe(105_000);
  });

  test('is not known where nothing sensible was kept', () => {
    expect(LastContact.kept()).toBeNull();
    kept.set('grace.contact', 'yesterday');
    expect(LastContact.kept()).toBeNull();
  });

  test('follows a clock that was set back', () => {
    const contact = new LastContact();
    contact.note(900_000);
    contact.note(100_000);
    expect(LastContact.kept()).toBe(100_000);
  });
});
