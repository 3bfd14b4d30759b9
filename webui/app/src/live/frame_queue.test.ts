import { afterEach, beforeEach, describe, expect, it, vi } from 'vitest';
import { FrameQueue } from './frame_queue';

let draw: (() => void) | null = null;

beforeEach(() => {
  vi.useFakeTimers();
  vi.stubGlobal('requestAnimationFrame', (callback: () => void) => {
    draw = callback;
    return 1;
  });
  vi.stubGlobal('cancelAnimationFrame', () => (draw = null));
});

afterEach(() => {
  vi.useRealTimers();
  vi.unstubAllGlobals();
});

describe('what comes between two pictures', () => {
  it('is taken in one go, in its order', () => {
    const taken: number[][] = [];
    const queue = new FrameQueue<number>((items) => taken.push([...items]));
    queue.put(1);
    queue.put(2);
    expect(taken).toEqual([]);
    draw?.();
    queue.put(3);
    draw?.();
    expect(taken).toEqual([[1, 2], [3]]);
    vi.advanceTimersByTime(1000);
    expect(taken.length).toBe(2);
  });

  it('is taken without a picture too, by a page that draws none', () => {
    const taken: number[][] = [];
    const queue = new FrameQueue<number>((items) => taken.push([...items]));
    queue.put(1);
    vi.advanceTimersByTime(100);
    expect(taken).toEqual([[1]]);
    expect(draw).toBeNull();
  });

  it('is forgotten when it concerns nobody any more', () => {
    const taken: number[][] = [];
    const queue = new FrameQueue<number>((items) => taken.push([...items]));
    queue.put(1);
    queue.clear();
    vi.advanceTimersByTime(1000);
    expect(taken).toEqual([]);
  });
});
