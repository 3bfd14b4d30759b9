import { describe, expect, it } from 'vitest';
import type { Role, Session } from '../api/types';
import { pilotsAny, roleFor, whyNotPilot } from './right';

function signedIn(role: Role, robots: Record<string, Role> = {}): Session {
  return {
    name: 'ann',
    role,
    rights: [],
    robots,
    is_link: false,
    csrf_token: null,
    expires_at: '2026-05-04T06:00:00Z',
  };
}

describe('what may be done with a robot', () => {
  it('is the higher of the role for all and the one for it', () => {
    for (const [forAll, granted, role] of [
      ['none', 'pilot', 'pilot'],
      ['viewer', 'admin', 'admin'],
      ['admin', 'viewer', 'admin'],
      ['pilot', 'none', 'pilot'],
    ] as const) {
      const session = signedIn(forAll, { 'mini-1': granted });
      expect(roleFor(session, 'mini-1')).toBe(role);
      expect(roleFor(session, 'grace-1')).toBe(forAll);
      expect(roleFor(session, null)).toBe(forAll);
    }
    expect(roleFor(null, 'mini-1')).toBe('none');
  });

  it('is said with its reason where it may not be', () => {
    const chosen = signedIn('viewer', { 'mini-1': 'pilot' });
    expect(whyNotPilot(chosen, 'mini-1', 'Mini 1')).toBe('');
    expect(whyNotPilot(chosen, 'grace-1', 'Grace 1')).toBe(
      'You may look at Grace 1; this needs a pilot of it.',
    );
    expect(whyNotPilot(chosen, null, null)).toContain('the whole station');
    expect(whyNotPilot(signedIn('viewer'), 'mini-1', 'Mini 1')).toContain('role of a pilot');
    expect(whyNotPilot(signedIn('pilot'), null, null)).toBe('');
    expect(whyNotPilot(null, 'mini-1', 'Mini 1')).not.toBe('');
  });

  it('is nothing for who only looks', () => {
    expect(pilotsAny(null)).toBe(false);
    expect(pilotsAny(signedIn('viewer', { 'mini-1': 'viewer' }))).toBe(false);
    expect(pilotsAny(signedIn('none', { 'mini-1': 'pilot' }))).toBe(true);
  });
});
