import { expect, test } from 'vitest';
import type { IncomingMessage, OutgoingMessage, SatelliteLog } from '../../api/types';
import { traceOf } from './satellite_trace';

const OUT: OutgoingMessage = {
  at: '2026-11-21T04:00:00Z', kind: 'plan', bytes: 270, credits: 6, state: 'taken',
  message_id: '91', mtmsn: 108, text: 'Part 1 of 2.',
}; // prettier-ignore
const IN: IncomingMessage = {
  session_at: '2026-11-21T05:00:00Z', arrived_at: '2026-11-21T05:01:00Z', momsn: 41, mtmsn: 108,
  bytes: 70, credits: 2, is_duplicate: false, is_decoded: true, text: 'State.',
}; // prettier-ignore

function log(outgoing: OutgoingMessage[], incoming: IncomingMessage[]): SatelliteLog {
  return {
    imei: '3', carrier: 'rockblock', credits_today: 6, credits_per_day: 100, credits_left: 94, credits_heard_today: 12,
    next_session_at: null, outgoing, incoming,
  }; // prettier-ignore
}

test('messages of all robots stand in one order, the newest first', () => {
  const trace = traceOf({
    'grace-1': log([OUT], [IN]),
    'grace-2': log([{ ...OUT, at: '2026-11-21T04:30:00Z' }], []),
  });
  expect(trace.map(({ robot, isOut }) => [robot, isOut])).toEqual([
    ['grace-1', false],
    ['grace-2', true],
    ['grace-1', true],
  ]);
  expect(trace[0]).toMatchObject({ momsn: 41, mtmsn: 108, credits: 2 });
});

test('what was not decoded is flagged, and a duplicate has no effect', () => {
  const [raw] = traceOf({ a: log([], [{ ...IN, is_decoded: false }]) });
  const [again] = traceOf({ a: log([], [{ ...IN, is_duplicate: true }]) });
  expect(raw).toMatchObject({ state: 'Not decoded', tone: 'watch' });
  expect(again).toMatchObject({ state: 'Duplicate, no effect', tone: 'plain' });
});

test('each message has a key of its own, also one that came twice', () => {
  const keys = traceOf({ a: log([OUT, { ...OUT, mtmsn: null, message_id: null }], [IN, IN]) });
  expect(new Set(keys.map(({ key }) => key)).size).toBe(4);
});
