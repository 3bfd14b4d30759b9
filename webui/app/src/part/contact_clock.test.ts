import { expect, test } from 'vitest';
import type { Contact } from '../api/types';
import { contactText } from './contact_clock';

const NOW = Date.parse('2026-11-24T10:00:00Z');
const moment = (seconds: number) => ({
  at: new Date(NOW + 1000 * seconds).toISOString(),
  source: 'plan-3 on board',
});

function contact(changes: Partial<Contact>): Contact {
  return {
    robot: 'mini-1',
    state: 'open',
    text: '',
    link: 'xbee',
    heard_at: null,
    since: null,
    closes: null,
    earliest: null,
    latest: null,
    opens: null,
    hears_under_water: false,
    ...changes,
  };
}

test('counts down to the dive that is expected', () => {
  expect(contactText(contact({ closes: moment(14) }), NOW)).toBe('dives in 14 s');
});

test('after that it may stay for its samples, not longer than it said', () => {
  const late = contact({ closes: moment(-3), latest: moment(12) });
  expect(contactText(late, NOW)).toBe('dives any moment, in 12 s at the latest');
  expect(contactText(contact({ closes: moment(-3) }), NOW)).toBe('dives any moment');
});

test('claims nothing that nobody said', () => {
  expect(contactText(null, NOW)).toBe('');
  expect(contactText(contact({}), NOW)).toBe('');
  expect(contactText(contact({ state: 'closed', closes: moment(5) }), NOW)).toBe('');
});
