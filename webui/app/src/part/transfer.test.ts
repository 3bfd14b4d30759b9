import { describe, expect, test } from 'vitest';
import type { Transfer, TransferPart } from '../api/types';
import { isTelling, transferEnd, transferSentence, transferSteps } from './transfer_steps';

function part(index: number, level: TransferPart['level']): TransferPart {
  const at = (second: number) => `2026-11-21T04:0${index}:0${second}Z`;
  return {
    index,
    bytes: 270,
    credits: 6,
    sends: level === 'waiting' ? 0 : 1,
    level,
    message_id: null,
    mtmsn: null,
    queued_at: level === 'waiting' ? null : at(1),
    radio_at: level === 'radio' ? at(5) : null,
  };
}

/** Also of words that this app does not know yet. */
type Changes = Partial<Omit<Transfer, 'state' | 'level'>> & { state?: string; level?: string };

function transfer(parts: TransferPart[], more: Changes = {}): Transfer {
  return {
    id: 'transfer-1',
    robot: 'grace-1',
    plan_id: 'plan-14',
    state: 'sending',
    level: 'queued',
    items: 0,
    items_sent: 0,
    bytes: 406,
    route: 'auto',
    carrier: '',
    sha256: null,
    expires_at: null,
    credits: 0,
    can_withdraw: false,
    text: '',
    started_at: '2026-11-21T04:00:00Z',
    ended_at: null,
    reason: '',
    parts,
    ...more,
  } as Transfer;
}

const shown = (of: Transfer) =>
  transferSteps(of).map(({ title, at, detail }) => [title, at !== null, detail ?? '']);

describe('a plan on its way by satellite', () => {
  test('is queued only once the gateway took every part', () => {
    expect(shown(transfer([part(0, 'queued'), part(1, 'waiting')]))).toEqual([
      ['Queued', false, '1 of 2'],
      ['Radio', false, ''],
      ['Applied', false, ''],
    ]);
  });

  test('reaches a level when its last part does', () => {
    const [queued, radio] = transferSteps(transfer([part(1, 'queued'), part(0, 'radio')]));
    expect(queued?.at).toBe('2026-11-21T04:01:01Z');
    expect(radio).toMatchObject({ at: null, detail: '1 of 2', isPending: true });
  });

  test('is not applied when the robot has every part and said nothing', () => {
    const steps = transferSteps(transfer([part(0, 'radio'), part(1, 'radio')], { level: 'radio' }));
    expect(steps.map(({ at }) => at !== null)).toEqual([true, true, false]);
    expect(steps[2]?.isPending).toBe(true);
  });

  test('is applied by the robot’s own word, which proves what came before it', () => {
    const ended = { state: 'on_board', level: 'applied', ended_at: '2026-11-21T05:00:00Z' };
    const steps = transferSteps(transfer([part(0, 'radio'), part(1, 'queued')], ended));
    expect(steps.every(({ at }) => at !== null)).toBe(true);
  });

  test('is applied while the robot has yet to start it', () => {
    const under = { state: 'on_board', level: 'applied' };
    const steps = transferSteps(transfer([part(0, 'radio')], under), '2026-11-21T05:00:00Z');
    expect(steps[2]).toMatchObject({ title: 'Applied', at: '2026-11-21T05:00:00Z' });
    expect(transferSteps(transfer([part(0, 'radio')], under))[2]?.at).not.toBeNull();
  });

  test('that ran out of time is not confirmed, whatever was proved', () => {
    const ended = { state: 'failed', level: 'radio', ended_at: '2026-11-25T04:00:00Z' };
    const steps = transferSteps(transfer([part(0, 'radio'), part(1, 'radio')], ended));
    expect(steps.map(({ title }) => title)).toEqual(['Queued', 'Radio', 'Not confirmed']);
    expect(steps.at(-1)?.isFault).toBe(true);
  });

  test('that was withdrawn or replaced is no fault', () => {
    for (const state of ['withdrawn', 'superseded']) {
      const steps = transferSteps(transfer([part(0, 'waiting')], { state, ended_at: 'now' }));
      expect(steps).toHaveLength(1);
      expect(steps[0]?.isFault).toBe(false);
    }
  });

  test('that ended in a way nobody foresaw is not taken for confirmed', () => {
    expect(transferEnd(transfer([], { state: 'lost', ended_at: 'now' }))).toBe('failed');
  });
});

test('a plan that came by radio is told by its own ladder alone', () => {
  const done = transfer([], { state: 'on_board', level: 'applied', ended_at: 'now' });
  expect(isTelling(done, 'running')).toBe(false);
  expect(isTelling({ ...done, parts: [part(0, 'radio')] }, 'running')).toBe(true);
  expect(isTelling({ ...done, state: 'failed', level: 'radio' }, 'draft')).toBe(true);
});

test('items of a plan are counted where the station says no more', () => {
  const sending = transfer([], { items: 12, items_sent: 3, carrier: 'xbee' });
  expect(transferSentence(sending)).toBe('Sending by XBee: 3 of 12 items.');
  expect(transferSentence({ ...sending, text: 'All is well.' })).toBe('All is well.');
});
