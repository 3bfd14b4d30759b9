import { describe, expect, test, vi } from 'vitest';
import type { Api } from '../api/client';
import { Cursor } from './cursor.svelte';
import { NewestQuestion } from './newest_question';
import { mayLeave } from './replay_gate';
import { ReplayWindow } from './replay_window.svelte';

const AT = Date.parse('2026-11-22T10:00:00Z');

describe('the cursor of a tab', () => {
  test('is in the address, and the same when it is read again', () => {
    const cursor = new Cursor('?at=2026-11-22T10:00:00Z&speed=5&clock=received');
    expect([cursor.at, cursor.speed, cursor.clock, cursor.mode]).toEqual([
      AT,
      5,
      'received',
      'replay',
    ]);
    cursor.loop = [AT, AT + 1000];
    const again = new Cursor(cursor.search());
    expect([again.at, again.speed, again.clock, again.loop]).toEqual([
      AT,
      5,
      'received',
      [AT, AT + 1000],
    ]);
    cursor.goLive();
    expect([cursor.search(), cursor.mode, cursor.loop]).toEqual(['', 'live', null]);
  });

  test('is live where the address says no moment, and never at a speed that there is not', () => {
    expect(new Cursor('?at=soon').mode).toBe('live');
    expect(new Cursor('?at=2026-11-22T10:00:00Z&speed=1e9').speed).toBe(1);
  });

  test('plays by its speed, stops at the end, and begins its loop anew', () => {
    const cursor = new Cursor('?at=2026-11-22T10:00:00Z&speed=100');
    cursor.advance(50, [AT, AT + 10_000]);
    expect(cursor.at).toBe(AT);
    cursor.playing = true;
    cursor.advance(50, [AT, AT + 10_000]);
    expect(cursor.at).toBe(AT + 5000);
    cursor.advance(60, [AT, AT + 10_000]);
    expect([cursor.at, cursor.playing]).toEqual([AT + 10_000, false]);
    cursor.loop = [AT + 1000, AT + 2000];
    cursor.playing = true;
    cursor.advance(1, [AT, AT + 10_000]);
    expect([cursor.at, cursor.playing]).toEqual([AT + 1000, true]);
  });
});

test('of many moments that are wanted the last is asked for, and none is asked for twice', async () => {
  const asked: number[] = [];
  const answers: (() => void)[] = [];
  const question = new NewestQuestion<number>((at) => {
    asked.push(at);
    return new Promise((go) => answers.push(go));
  });
  for (const at of [1, 2, 3]) question.want(at);
  expect(asked).toEqual([1]);
  answers[0]?.();
  await Promise.resolve();
  await Promise.resolve();
  expect(asked).toEqual([1, 3]);
});

describe('of a replay', () => {
  const sent = (method: string, path: string, body?: unknown) =>
    mayLeave(
      new Request(`http://station${path}`, {
        method,
        ...(body === undefined ? {} : { body: JSON.stringify(body) }),
      }),
    );

  test('Surface now is sent, and no other order', async () => {
    expect(await sent('POST', '/api/robots/a/commands', { kind: 'surface' })).toBe(true);
    expect(await sent('POST', '/api/robots/a/commands', { kind: 'start' })).toBe(false);
  });

  test('no plan, setting or switch leaves the page, and an alarm is seen', async () => {
    expect(await sent('POST', '/api/plans/plan-1/upload', {})).toBe(false);
    expect(await sent('PATCH', '/api/config/planner', {})).toBe(false);
    expect(await sent('PATCH', '/api/robots/a/view', {})).toBe(false);
    expect(await sent('POST', '/api/alarms/alarm-1/acknowledge', {})).toBe(true);
  });

  test('a film is made of the past, and called off', async () => {
    expect(await sent('POST', '/api/robots/a/films', {})).toBe(true);
    expect(await sent('DELETE', '/api/jobs/job-1')).toBe(true);
    expect(await sent('POST', '/api/jobs/job-1/x', {})).toBe(false);
  });
});

describe('a window about a cursor', () => {
  /** A window of an hour, and from which hour on it asked for what. */
  function hourly(fails: () => boolean = () => false) {
    const asked: number[] = [];
    const samples = (_: string, { start }: { start?: string | null }) => {
      const hour = Date.parse(start ?? '') / 3_600_000;
      asked.push(hour);
      if (fails()) return Promise.reject(new Error('busy'));
      return Promise.resolve({ measured_at: [start], value: [hour], unit: 'm' });
    };
    const window = new ReplayWindow({ samples } as unknown as Api, 'mini-1', 'depth_m', 3600);
    return { window, asked };
  }

  test('never lets go of a part that it shows, however long ago that was read', async () => {
    const { window } = hourly();
    for (const hour of [100.5, ...Array.from({ length: 11 }, (_, n) => 200.5 + 2 * n), 99.6]) {
      window.want(hour * 3600, 0);
      await vi.waitFor(() => expect(window.show(hour * 3600).isWhole).toBe(true));
    }
  });

  /** A window that was told three values, of which the station heard the second late. */
  async function told(received_at: string[] | null) {
    const at = ['1970-01-05T04:10:00Z', '1970-01-05T04:20:00Z', '1970-01-05T04:40:00Z'];
    const samples = (_: string, { start }: { start?: string | null }) => {
      const isHere = start === '1970-01-05T04:00:00.000Z';
      return Promise.resolve({
        measured_at: isHere ? at : [],
        value: isHere ? [1, 2, 3] : [],
        unit: 'm',
        received_at: isHere ? received_at : received_at && [],
      });
    };
    const window = new ReplayWindow({ samples } as unknown as Api, 'mini-1', 'depth_m', 3600);
    window.want(100.5 * 3600, 0);
    await vi.waitFor(() => expect(window.show(100.5 * 3600).isWhole).toBe(true));
    return window;
  }

  test('leaves out what the station had not heard by then, if that is asked', async () => {
    const heard = ['1970-01-05T04:10:01Z', '1970-01-05T04:35:00Z', '1970-01-05T04:40:01Z'];
    const window = await told(heard);
    expect(window.show(100.5 * 3600).v).toEqual([1, 2, 3]);
    expect(window.show(100.5 * 3600, 'received').v).toEqual([1]);
    expect(window.show(100.6 * 3600, 'received')).toMatchObject({ v: [1, 2], isArrivalKept: true });
  });

  test('tells that the arrival is not kept, and nothing of what was measured later', async () => {
    const window = await told(null);
    const shown = window.show(100.5 * 3600, 'received');
    expect(shown).toMatchObject({ v: [1, 2], isArrivalKept: false });
  });

  test('asks again for a part that it was refused while it is wanted, and then no more', async () => {
    vi.useFakeTimers();
    let isBusy = true;
    const { window, asked } = hourly(() => isBusy);
    const end = window.want(100.25 * 3600, 0);
    await vi.advanceTimersByTimeAsync(7000);
    expect(asked.filter((hour) => hour === 100).length).toBeGreaterThan(1);
    isBusy = false;
    await vi.advanceTimersByTimeAsync(4000);
    expect(window.show(100.25 * 3600).isWhole).toBe(true);
    isBusy = true;
    window.want(500.25 * 3600, 0);
    end();
    const before = asked.length;
    await vi.advanceTimersByTimeAsync(20_000);
    expect(asked.length).toBe(before);
    vi.useRealTimers();
  });
});
