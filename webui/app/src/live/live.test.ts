import { afterEach, beforeEach, describe, expect, test, vi } from 'vitest';
import { locationPath, problemOf } from '../api/problem';
import { queryString } from '../api/address';
import { mergeEvents } from '../page/log/merge';
import { parseRoute, routePath } from '../page/route';
import type { StationEvent } from '../api/types';
import { StationClock } from './clock';
import { LiveSocket } from './socket';

class FakeSocket {
  static all: FakeSocket[] = [];
  onopen: (() => void) | null = null;
  onmessage: ((message: { data: string }) => void) | null = null;
  onclose: ((event: { code: number }) => void) | null = null;
  close = vi.fn();

  constructor(readonly url: string) {
    FakeSocket.all.push(this);
  }

  static get last(): FakeSocket {
    const socket = FakeSocket.all.at(-1);
    if (!socket) throw new Error('nothing was opened');
    return socket;
  }
}

describe('the live stream', () => {
  beforeEach(() => {
    FakeSocket.all = [];
    vi.useFakeTimers();
    vi.stubGlobal('WebSocket', FakeSocket);
    vi.stubGlobal('location', { protocol: 'http:', host: 'station:8000' });
  });
  afterEach(() => {
    vi.useRealTimers();
    vi.unstubAllGlobals();
  });

  function opened() {
    const events = { onTick: vi.fn(), onOpen: vi.fn(), onClose: vi.fn() };
    const socket = new LiveSocket(events);
    socket.open();
    FakeSocket.last.onopen?.();
    return { socket, events };
  }

  test('resumes after the last event that it saw', () => {
    opened();
    expect(FakeSocket.last.url).toBe('ws://station:8000/api/live');
    FakeSocket.last.onmessage?.({ data: '{"at":"2026-11-21T00:00:00Z","cursor":41}' });
    FakeSocket.last.onclose?.({ code: 1006 });
    vi.advanceTimersByTime(600);
    expect(FakeSocket.all).toHaveLength(2);
    expect(FakeSocket.last.url).toBe('ws://station:8000/api/live?after=41');
  });

  test('notices a connection that is dead without saying so', () => {
    const { events } = opened();
    vi.advanceTimersByTime(10_500);
    expect(FakeSocket.all[0]?.close).toHaveBeenCalled();
    expect(events.onClose).toHaveBeenCalledWith(false);
    vi.advanceTimersByTime(600);
    expect(FakeSocket.all).toHaveLength(2);
  });

  test('says when it was turned away', () => {
    const { events } = opened();
    FakeSocket.last.onclose?.({ code: 1008 });
    expect(events.onClose).toHaveBeenCalledWith(true);
  });

  test('stays closed once it was closed', () => {
    const { socket } = opened();
    const { last } = FakeSocket;
    socket.close();
    last.onclose?.({ code: 1000 });
    vi.advanceTimersByTime(60_000);
    expect(FakeSocket.all).toHaveLength(1);
  });
});

describe('the clock of the station', () => {
  test('runs at its own speed', () => {
    const clock = new StationClock();
    clock.speed = 20;
    clock.set(1_000_000, 500);
    expect(clock.at(1500)).toBe(1_020_000);
    expect(clock.since(500, 1000)).toBe(10);
    expect(clock.since(2000, 1000)).toBe(0);
  });
});

describe('a refusal', () => {
  test('carries its sentence and the fields it names', async () => {
    const body = {
      title: 'Unprocessable Entity',
      detail: '1 field is wrong.',
      errors: [{ loc: ['body', 'config', 'domain', 'depth_max_m'], msg: 'too deep' }],
    };
    const problem = await problemOf(new Response(JSON.stringify(body), { status: 422 }));
    expect(problem.sentence).toBe('1 field is wrong.');
    expect(problem.errors).toEqual([{ path: ['domain', 'depth_max_m'], message: 'too deep' }]);
  });

  test('without a document is named by its status', async () => {
    const problem = await problemOf(new Response('<html>', { status: 502 }));
    expect(problem.sentence).toBe('The station answered 502.');
  });

  test('knows paths written either way', () => {
    expect(locationPath(['body', 'x', 0])).toEqual(['x', '0']);
    expect(locationPath('config.domain.x_max_m')).toEqual(['domain', 'x_max_m']);
    expect(locationPath(undefined)).toEqual([]);
  });
});

describe('addresses', () => {
  test('name a page and a robot', () => {
    expect(parseRoute('/plan/grace-1')).toEqual({
      page: 'plan',
      robot: 'grace-1',
      section: '',
      at: null,
    });
    expect(parseRoute('/')).toEqual({ page: 'fleet', robot: null, section: '', at: null });
    expect(parseRoute('/nowhere')).toEqual({ page: 'fleet', robot: null, section: '', at: null });
    expect(parseRoute('/robot/%E0%A4%A')).toEqual({
      page: 'robot',
      robot: null,
      section: '',
      at: null,
    });
    const then = parseRoute('/robot/mini-1', '', '?at=2026-11-21T04:23:48Z');
    expect(then.at).toBe('2026-11-21T04:23:48.000Z');
    expect(parseRoute('/robot/mini-1', '', '?at=soon').at).toBeNull();
  });

  test.each(['robot', 'plan', 'map', 'control', 'data'] as const)(
    'of %s lead back to it',
    (page) => {
      expect(parseRoute(routePath(page, 'a b'))).toEqual({
        page,
        robot: 'a b',
        section: '',
        at: null,
      });
    },
  );

  test('keep the part of a page that is open', () => {
    expect(routePath('control', 'mini-1', 'what-if')).toBe('/control/mini-1#what-if');
    expect(parseRoute('/control/mini-1', '#what-if').section).toBe('what-if');
    expect(parseRoute('/control/mini-1', '#%E0').section).toBe('');
  });

  test('leave out what is not asked for', () => {
    expect(queryString({ a: 1, b: null, c: undefined, d: 'x y' })).toBe('?a=1&d=x+y');
    expect(queryString()).toBe('');
  });
});

test('events from two sources are one list without doubles', () => {
  const event = (cursor: number) => ({ cursor }) as StationEvent;
  const merged = mergeEvents([event(1), event(3)], [event(3), event(2)]);
  expect(merged.map(({ cursor }) => cursor)).toEqual([1, 2, 3]);
});
