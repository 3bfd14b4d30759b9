import { describe, expect, it } from 'vitest';
import type { Robot } from '../../api/types';
import { isFound, LOW_BATTERY, needOf, NEEDS, ordered, SOON_S, type Known } from './need';

const NOW = Date.parse('2026-11-21T12:00:00Z');
const FINE: Known = {
  level: 'normal',
  link: { state: 'live', carrier: 'xbee' },
  contactAt: null,
  battery: 0.8,
};

function inS(seconds: number): number {
  return NOW + 1000 * seconds;
}

function named(name: string): Robot {
  return {
    id: name,
    name,
    model: 'Miniglider',
    kind: 'simulated',
    site: { name: 'Test tank' },
  } as unknown as Robot;
}

describe('what a robot needs most', () => {
  it.each([
    ['severe or critical alarm', { level: 'severe', link: { state: 'stale', carrier: 'xbee' } }],
    ['out of contact', { link: { state: 'stale', carrier: 'xbee' }, level: 'watch' }],
    ['out of contact', { link: { state: 'port_closed', carrier: 'xbee' } }],
    ['contact overdue', { contactAt: inS(-1), level: 'watch' }],
    ['alarm', { level: 'watch', battery: 0.1 }],
    ['battery low', { battery: LOW_BATTERY - 0.01, contactAt: inS(60) }],
    ['surfaces soon', { contactAt: inS(SOON_S - 1) }],
    ['nothing', { contactAt: inS(SOON_S + 1) }],
    ['nothing', { battery: null }],
    ['nothing', { link: { state: 'submerged', carrier: 'xbee' } }],
    ['nothing', { level: 'info' }],
  ] as const)('is %s', (need, changed) => {
    expect(needOf({ ...FINE, ...changed }, NOW)).toBe(need);
  });
});

describe('the order of robots', () => {
  it('begins with who needs somebody most, and counts within a name', () => {
    const entries = NEEDS.toReversed().flatMap((need, at) => [
      { robot: named(`mini-${at + 10}`), need },
      { robot: named(`mini-${at + 2}`), need },
    ]);
    const found = ordered(entries, 'need');
    expect(found.map(({ need }) => need)).toEqual(NEEDS.flatMap((need) => [need, need]));
    expect(found.slice(0, 2).map(({ robot }) => robot.name)).toEqual(['mini-8', 'mini-16']);
  });

  it('is that of numbers where names are asked for', () => {
    const names = ['mini-10', 'grace-2', 'mini-2'];
    const entries = names.map((name) => ({ robot: named(name), need: 'nothing' as const }));
    const found = ordered(entries, 'name').map(({ robot }) => robot.name);
    expect(found).toEqual(['grace-2', 'mini-2', 'mini-10']);
  });
});

describe('the search', () => {
  it('finds by each word that was typed, in any order', () => {
    expect(isFound(named('mini-7'), 'TANK 7')).toBe(true);
    expect(isFound(named('mini-7'), '')).toBe(true);
    expect(isFound(named('mini-7'), 'lake')).toBe(false);
  });
});
