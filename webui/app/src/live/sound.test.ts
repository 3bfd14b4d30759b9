import { afterEach, beforeEach, describe, expect, test, vi } from 'vitest';
import { Sound } from './sound.svelte';
import { freshOf, keyOf, PATTERNS, soundOf, tabTitle } from './sound_pattern';

const leak = { id: 'alarm-1', raised_at: '2026-07-01T04:31:00Z', level: 'critical' } as const;
const battery = { id: 'alarm-2', raised_at: '2026-07-01T04:30:00Z', level: 'warning' } as const;

describe('what is heard and seen of alarms', () => {
  test('is the gravest of them', () => {
    expect(soundOf([battery, leak])).toBe('critical');
    expect(soundOf([battery])).toBe('warning');
    expect(soundOf([{ ...battery, level: 'info' }])).toBeNull();
    expect(soundOf([])).toBeNull();
  });

  test('is fresh when it was raised again or got worse', () => {
    const known = new Set([keyOf(battery)]);
    expect(freshOf(known, [battery, leak])).toEqual([leak]);
    expect(freshOf(known, [{ ...battery, level: 'critical' }])).toHaveLength(1);
    expect(freshOf(known, [{ ...battery, raised_at: leak.raised_at }])).toHaveLength(1);
  });

  test('stands in the tab', () => {
    expect(tabTitle('Fleet', 2)).toBe('(2) Fleet · Grace Ground Station');
    expect(tabTitle('Fleet', 0)).toBe('Fleet · Grace Ground Station');
  });

  test('differs in rhythm from level to level', () => {
    const rhythms = Object.values(PATTERNS).map((tones) => tones.map(({ at }) => at).join(' '));
    expect(new Set(rhythms).size).toBe(rhythms.length);
  });
});

describe('sounds', () => {
  const started: number[] = [];
  class FakeContext {
    state = 'suspended';
    currentTime = 0;
    destination = {};
    onstatechange: (() => void) | null = null;
    resume(): Promise<void> {
      this.state = 'running';
      return Promise.resolve();
    }
  }
  const connect = (next: unknown): unknown => next;
  class FakeOscillator {
    connect = connect;
    stop = vi.fn();
    start = (at: number): void => void started.push(at);
  }
  class FakeGain {
    connect = connect;
    gain = { setValueAtTime: vi.fn(), linearRampToValueAtTime: vi.fn() };
  }

  beforeEach(() => {
    vi.useFakeTimers();
    started.length = 0;
    vi.stubGlobal('localStorage', { getItem: () => null, setItem: vi.fn() });
    vi.stubGlobal('AudioContext', FakeContext);
    vi.stubGlobal('OscillatorNode', FakeOscillator);
    vi.stubGlobal('GainNode', FakeGain);
  });
  afterEach(() => {
    vi.useRealTimers();
    vi.unstubAllGlobals();
  });

  test('are not heard before the page was touched, and it says so', async () => {
    const sound = new Sound();
    expect(sound.isBlocked).toBe(true);
    expect(sound.play('critical')).toBe(false);
    await sound.unblock();
    expect(sound.isBlocked).toBe(false);
    expect(sound.play('critical')).toBe(true);
    expect(started).toHaveLength(PATTERNS.critical.length);
  });

  test('are heard from the end of a click on, for no button moves while it is pressed', async () => {
    const page = new EventTarget();
    vi.stubGlobal('window', page);
    const sound = new Sound();
    const stop = sound.listen();
    page.dispatchEvent(new Event('pointerdown'));
    await vi.advanceTimersByTimeAsync(0);
    expect(sound.isBlocked).toBe(true);
    page.dispatchEvent(new Event('click'));
    await vi.advanceTimersByTimeAsync(0);
    expect(sound.isBlocked).toBe(false);
    stop();
  });

  test('of a critical alarm come again until it is acknowledged', async () => {
    const sound = new Sound();
    await sound.unblock();
    sound.repeat('critical');
    vi.advanceTimersByTime(11_000);
    expect(started).toHaveLength(2 * PATTERNS.critical.length);
    sound.repeat(null);
    vi.advanceTimersByTime(60_000);
    expect(started).toHaveLength(2 * PATTERNS.critical.length);
  });

  test('of a warning come once', async () => {
    const sound = new Sound();
    await sound.unblock();
    sound.repeat('warning');
    vi.advanceTimersByTime(60_000);
    expect(started).toHaveLength(0);
    expect(sound.repeated).toBeNull();
  });

  test('are muted for a while and come back by themselves', async () => {
    const sound = new Sound();
    await sound.unblock();
    sound.mute(10);
    expect(sound.play('critical')).toBe(false);
    vi.advanceTimersByTime(10 * 60_000);
    expect(sound.play('critical')).toBe(true);
  });
});
