import { describe, expect, it } from 'vitest';
import {
  chargeText,
  isRequestable,
  minutes,
  refusedText,
  silentNow,
  unansweredText,
  type ToldLease,
} from './lease.svelte';

const HELD: ToldLease = {
  robot: 'mini-1',
  state: 'held',
  holder: 'ann',
  holder_kind: 'person',
  is_mine: false,
  since: '2026-05-04T06:00:00Z',
  reason: '',
  silent_s: 0,
  is_silent: false,
  request: null,
  script: '',
  asking: null,
  by_radio: '',
  refusal: 'ann is in charge of mini-1; request it from them first.',
  receivedAt: 1000,
};

describe('who is in charge', () => {
  it('is said in few words', () => {
    expect(chargeText(null, 1000)).toBe('');
    expect(chargeText({ ...HELD, state: 'free', holder: '' }, 1000)).toBe('Nobody is in charge');
    expect(chargeText({ ...HELD, is_mine: true }, 1000)).toBe('You are in charge');
    expect(chargeText(HELD, 1000)).toBe('ann is in charge');
    expect(chargeText({ ...HELD, holder_kind: 'script' }, 1000)).toBe('script ann is in charge');
  });

  it('counts silence on from the age that the station told, by no clock of its own', () => {
    const silent = { ...HELD, silent_s: 200 };
    expect(silentNow(silent, 41_000)).toBe(240);
    expect(chargeText(silent, 41_000)).toBe('ann is in charge, silent for 4 min');
    expect(silentNow(HELD, 900_000)).toBe(0);
  });

  it('says what becomes of a request that nobody answers', () => {
    expect(unansweredText(HELD, 1000)).toBe('');
    const asked = { by: 'ben', at: '2026-05-04T06:00:00Z', note: '' };
    const byPerson = { ...HELD, request: { ...asked, granted_in_s: 600, ends_in_s: null } };
    expect(unansweredText(byPerson, 121_000)).toBe('Granted by itself in 8 min without an answer.');
    const byStation = { ...HELD, request: { ...asked, granted_in_s: null, ends_in_s: 30 } };
    expect(unansweredText(byStation, 11_000)).toBe('Refused by itself in 20 s without an answer.');
    expect([HELD, byPerson, byStation].map(isRequestable)).toEqual([true, false, true]);
    expect(unansweredText(byStation, 90_000)).toBe('Refused by itself in 0 s without an answer.');
  });

  it('rounds a time down to what has passed', () => {
    expect(minutes(59)).toBe('less than a minute');
    expect(minutes(119)).toBe('1 min');
    expect(minutes(3 * 3600)).toBe('3 h');
  });
});

describe('a request that was refused', () => {
  const at = '2026-05-04T06:00:00Z';
  const no = { kind: 'lease.refused', robot: 'mini-1', text: 'ann refused ben mini-1.', at };

  it('is told to who asked, of that robot alone, until something else is said of the lease', () => {
    expect(refusedText([no], 'mini-1', 'ben')).toBe('06:00:00Z ann refused ben mini-1.');
    expect(refusedText([no], 'mini-1', 'eve')).toBe('');
    expect(refusedText([no], 'grace-1', 'ben')).toBe('');
    const anew = { kind: 'lease.requested', robot: 'mini-1', text: 'ben asks.', at };
    expect(refusedText([no, anew], 'mini-1', 'ben')).toBe('');
    const heard = { kind: 'plan.draft', robot: 'mini-1', text: 'A draft.', at };
    expect(refusedText([no, heard], 'mini-1', 'ben')).not.toBe('');
  });
});
