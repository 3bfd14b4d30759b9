import { afterEach, beforeEach, describe, expect, test, vi } from 'vitest';
import { DriveLink } from './drive_link.svelte';
import { CENTRE, type Stick } from './stick';

/** A line that takes everything at once, and notes when. */
class FakeSocket {
  static readonly OPEN = 1;
  static newest: FakeSocket;
  readyState = FakeSocket.OPEN;
  bufferedAmount = 0;
  readonly sent: { at: number; stick: Stick }[] = [];
  onmessage: ((message: { data: string }) => void) | null = null;
  onclose: (() => void) | null = null;

  constructor() {
    FakeSocket.newest = this;
  }

  send(text: string): void {
    if (text === 'stop') return;
    const { forward, turn, up } = JSON.parse(text) as Stick;
    this.sent.push({ at: performance.now(), stick: { forward, turn, up } });
  }

  close(): void {
    this.onclose?.();
  }
}

/** From a change of the stick to the word of it, ms; a robot's own period is 100 ms. */
const AT_ONCE_MS = 40;
const AHEAD: Stick = { forward: 0.6, turn: 0, up: 0 };

let held: Stick | null = null;
let link: DriveLink;

beforeEach(() => {
  vi.useFakeTimers();
  vi.stubGlobal('WebSocket', FakeSocket);
  vi.stubGlobal('location', { protocol: 'http:', host: 'station' });
  vi.stubGlobal('document', { hidden: false, hasFocus: () => true });
  held = null;
  link = new DriveLink('mini-1', () => held);
  link.begin();
  const told = { state: 'driving', newest: null, reason: '' };
  FakeSocket.newest.onmessage?.({ data: JSON.stringify(told) });
});

afterEach(() => {
  vi.useRealTimers();
  vi.unstubAllGlobals();
});

function said(): Stick[] {
  return FakeSocket.newest.sent.map(({ stick }) => stick);
}

describe('a stick', () => {
  test('that is held is said again and again', () => {
    held = AHEAD;
    vi.advanceTimersByTime(2000);
    expect(said().length).toBeGreaterThan(20);
    expect(said().every(({ forward }) => forward === 0.6)).toBe(true);
    expect(link.silentAt).toBeNull();
  });

  test('that is let go is said to be in the middle at once, and then nothing is said', () => {
    held = AHEAD;
    vi.advanceTimersByTime(300 + 700 * Math.random());
    const before = said().length;
    const at = performance.now();
    held = null;
    vi.advanceTimersByTime(500);
    const after = FakeSocket.newest.sent.slice(before);
    expect(after[0]?.stick).toEqual(CENTRE);
    expect((after[0]?.at ?? Infinity) - at).toBeLessThan(AT_ONCE_MS);
    expect(after.length).toBeGreaterThan(1);
    expect(after.every(({ stick }) => stick.forward === 0)).toBe(true);
    const count = said().length;
    vi.advanceTimersByTime(60_000);
    expect(said()).toHaveLength(count);
    expect(link.silentAt).not.toBeNull();
  });

  test('that waits for a line which is stuck is not forgotten when it is let go', () => {
    held = AHEAD;
    vi.advanceTimersByTime(300);
    FakeSocket.newest.bufferedAmount = 80;
    held = null;
    vi.advanceTimersByTime(400);
    expect(said().at(-1)).toEqual(AHEAD);
    FakeSocket.newest.bufferedAmount = 0;
    vi.advanceTimersByTime(AT_ONCE_MS);
    expect(said().at(-1)).toEqual(CENTRE);
  });

  test('that is held in the middle keeps the robot where it is', () => {
    held = CENTRE;
    vi.advanceTimersByTime(3000);
    expect(said().length).toBeGreaterThan(20);
    expect(link.silentAt).toBeNull();
  });

  test('that is held again after a silence is said again', () => {
    vi.advanceTimersByTime(5000);
    expect(link.silentAt).not.toBeNull();
    held = AHEAD;
    vi.advanceTimersByTime(AT_ONCE_MS);
    expect(said().at(-1)).toEqual(AHEAD);
    expect(link.silentAt).toBeNull();
  });
});
