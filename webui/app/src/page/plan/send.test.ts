import { describe, expect, test } from 'vitest';
import type { Plan, RobotLink, SatelliteQuote } from '../../api/types';
import { priceText, reservations, sizesText, startText, wayOf } from './send';

const RADIO = { kind: 'radio', carrier: 'xbee', state: 'live', is_plugged: true } as RobotLink;
const SPACE = { kind: 'satellite', carrier: 'rockblock', is_plugged: true } as RobotLink;
const QUOTE = {
  credits: 10,
  credits_left_today: 88,
  refusal: null,
  auto: { route: 'radio', reason: 'By radio, which reaches the robot.' },
} as SatelliteQuote;

describe('the way of a plan', () => {
  test('is the one that was chosen', () => {
    expect(wayOf('satellite', [RADIO, SPACE], QUOTE).route).toBe('satellite');
  });

  test('by radio says so where no radio hears the robot', () => {
    expect(wayOf('radio', [RADIO, SPACE], QUOTE).reason).toBe('By radio, as you chose.');
    const far = [{ ...RADIO, state: 'never_heard' }, SPACE] as RobotLink[];
    expect(wayOf('radio', far, QUOTE).reason).toContain('waits');
  });

  test('is the station’s where it is left to it', () => {
    expect(wayOf('auto', [SPACE], QUOTE)).toEqual(QUOTE.auto);
  });

  test('is guessed by the same rule while the station has not said', () => {
    expect(wayOf('auto', [RADIO, SPACE], null).route).toBe('radio');
    expect(wayOf('auto', [{ ...RADIO, state: 'stale' }, SPACE], null).route).toBe('satellite');
    expect(wayOf('auto', [{ ...RADIO, is_plugged: false }, SPACE], null).route).toBe('satellite');
    expect(wayOf('auto', [{ ...RADIO, state: 'stale' }], null).route).toBe('radio');
  });
});

describe('what it costs', () => {
  test('is told with its currency, or not at all', () => {
    expect(priceText(1.2, 'GBP')).toBe('1.20 GBP');
    expect(priceText(0, '')).toBe('no price set');
    expect(sizesText([{ bytes: 270 }, { bytes: 176 }])).toBe('270 + 176 B');
  });
});

describe('what speaks against sending a draft', () => {
  const AWAY = { field: 'mission.draft_distance_m', message: 'The robot is 4 m away.' };
  const FLAWED = { state: 'done', completed: false, entered: [], message: 'It ran aground.' };
  const draft = { state: 'draft', outdated: [AWAY], rehearsal: FLAWED } as unknown as Plan;

  test('is known before it is held, whoever would refuse it then', () => {
    expect(reservations(draft)).toEqual([AWAY.message, 'Its rehearsal says: It ran aground.']);
    expect(reservations({ ...draft, outdated: [], rehearsal: null })).toEqual([]);
    const message = 'The expected track leaves the lake by its north edge.';
    const broken = [
      { field: 'domain', message },
      { field: 'margin_m', message: 'The expected track comes within 0.1 m of the reeds.' },
    ];
    const out = { ...FLAWED, completed: true, broken } as unknown as Plan['rehearsal'];
    expect(reservations({ ...draft, outdated: [], rehearsal: out })).toEqual([
      `Its rehearsal says: ${message}`,
    ]);
  });

  test('does not concern a plan that has left the station', () => {
    expect(reservations({ ...draft, state: 'running' })).toEqual([]);
  });
});

describe('when a plan starts', () => {
  const who = { robot: 'Mini', plan: 'plan 7', aboard: 'plan 3', isFlying: false };

  test('is said for a robot that rests, and for one that flies', () => {
    expect(startText(who, 'now')).toMatch(/^Mini keeps plan 3 until .* starts plan 7 by itself/);
    const flying = startText({ ...who, isFlying: true }, 'now');
    expect(flying).toContain('waits on board and starts at the next surfacing');
  });

  test('is told from when it is sent', () => {
    const later = startText({ ...who, aboard: null }, 'time');
    expect(later).toMatch(/^Once it is sent, Mini keeps what it has/);
  });
});
