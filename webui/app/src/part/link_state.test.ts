import { describe, expect, test } from 'vitest';
import type { RobotLink } from '../api/types';
import { linkWord } from '../text/word';
import {
  carriedText,
  hasSatellite,
  lastHeard,
  linkAge,
  shownState,
  signingHelp,
  stateIcon,
  unplugText,
} from './link_state';

function link(carrier: string, kind: RobotLink['kind'], more: Partial<RobotLink> = {}): RobotLink {
  return {
    uri: `${carrier}://1`,
    carrier,
    kind,
    state: 'live',
    is_plugged: true,
    heard_at: null,
    rssi_dbm: null,
    frames_received: 0,
    frames_bad: 0,
    is_signed: kind === 'radio' ? false : null,
    text: '',
    carries: [],
    ...more,
  };
}

const RADIO = link('xbee', 'radio', { heard_at: '2026-11-21T04:00:00Z' });
const SPACE = link('rockblock', 'satellite', { heard_at: '2026-11-21T04:30:00.5Z' });
const SIGHT = link('cameras', 'camera', { heard_at: '2026-11-21T04:59:30Z' });
const SOUND = link('micromodem', 'acoustic', { heard_at: '2026-11-21T04:59:00Z' });

describe('the links of a robot', () => {
  test('say what it means that a radio is not signed', () => {
    expect(signingHelp(RADIO)).toContain('can pose as the robot');
    expect(signingHelp({ is_signed: true })).toContain('are believed');
  });

  test('tell by which of them it was heard last', () => {
    expect(lastHeard([RADIO, SPACE, SOUND])?.carrier).toBe('rockblock');
    expect(lastHeard([link('xbee', 'radio'), SOUND, SIGHT])).toBeNull();
  });

  test('by satellite call now and then, and are never live', () => {
    expect(linkWord('live', 'rockblock')).toMatchObject({ text: 'Calls regularly', tone: 'plain' });
    expect(linkWord('live', 'xbee')).toMatchObject({ text: 'Live', tone: 'ok' });
    expect(stateIcon('live', 'rockblock')).not.toBe(stateIcon('live', 'xbee'));
  });

  test('tell how long ago, and never of the future', () => {
    expect(linkAge(RADIO, Date.parse('2026-11-21T04:01:00Z'))).toBe(60);
    expect(linkAge(RADIO, Date.parse('2026-11-21T03:00:00Z'))).toBe(0);
    expect(linkAge(link('xbee', 'radio'), 0)).toBeNull();
  });

  test('are unplugged whatever else is known of them', () => {
    expect(shownState({ ...RADIO, is_plugged: false })).toBe('unplugged');
    expect(shownState(RADIO)).toBe('live');
  });

  test('have a shape for each state', () => {
    const states = [
      'live',
      'stale',
      'submerged',
      'never_heard',
      'mute',
      'port_closed',
      'unplugged',
    ];
    expect(new Set(states.map((state) => String(stateIcon(state)))).size).toBe(states.length);
  });

  test('say what they carry', () => {
    expect(carriedText(['plan', 'command', 'surface'])).toBe('plans, orders');
    expect(carriedText(['surface'])).toBe('orders to surface');
    expect(carriedText([])).toBe('nothing now');
    expect(hasSatellite([RADIO, SPACE])).toBe(true);
  });
});

describe('before a plug is pulled', () => {
  test('the links that remain are named', () => {
    expect(unplugText('grace-1', RADIO, [RADIO, SPACE, SOUND])).toContain('only by RockBLOCK');
  });

  test('the other robots at the same port are named', () => {
    const text = unplugText('grace-1', RADIO, [RADIO, SPACE], ['mini-1', 'mini-2']);
    expect(text).toContain('The same port serves mini-1 and mini-2.');
  });

  test('the last one is said to be the last', () => {
    const text = unplugText('grace-1', SPACE, [{ ...RADIO, is_plugged: false }, SPACE, SOUND]);
    expect(text).toContain('No other link reaches grace-1');
    expect(text).toContain('the gateway keeps what grace-1 says');
  });
});
