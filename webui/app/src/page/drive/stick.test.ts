import { describe, expect, it } from 'vitest';
import { CENTRE, DEAD_ZONE, limited, ofFinger, ofGamepad, ofKeys, steeringKey } from './stick';
import { RoundTrips } from './round_trips';

describe('keys', () => {
  it('add up, and opposite ones cancel each other', () => {
    expect(ofKeys(['w', 'd'])).toEqual({ forward: 1, turn: 1, up: 0 });
    expect(ofKeys(['a', 'd', 'f'])).toEqual({ forward: 0, turn: 0, up: -1 });
    expect(ofKeys(['w', 'ArrowUp'])).toEqual({ forward: 1, turn: 0, up: 0 });
    expect(ofKeys([])).toEqual(CENTRE);
  });

  it('steer with capitals too, and no other key does', () => {
    expect(steeringKey('W')).toBe('w');
    expect(steeringKey('ArrowLeft')).toBe('ArrowLeft');
    expect(steeringKey('x')).toBeNull();
    expect(steeringKey('toString')).toBeNull();
  });
});

describe('finger', () => {
  it('never reaches beyond the rim', () => {
    expect(ofFinger(0, -1)).toEqual({ forward: 1, turn: 0 });
    const { forward, turn } = ofFinger(3, -4);
    expect(Math.hypot(forward, turn)).toBeCloseTo(1);
    expect(turn).toBeCloseTo(0.6);
  });
});

describe('gamepad', () => {
  it('rests within its dead zone and begins at 0 behind it', () => {
    expect(ofGamepad([DEAD_ZONE, -DEAD_ZONE, 0, 0.05])).toEqual(CENTRE);
    expect(ofGamepad([0, -1, 0, 1])).toEqual({ forward: 1, turn: 0, up: -1 });
    const { turn } = ofGamepad([DEAD_ZONE + 0.01, 0]);
    expect(turn).toBeGreaterThan(0);
    expect(turn).toBeLessThan(0.02);
  });

  it('that has no such axis leaves it in the middle', () => {
    expect(ofGamepad([])).toEqual(CENTRE);
  });
});

it('a limited stick dives as before', () => {
  expect(limited({ forward: 1, turn: -1, up: 1 }, 0.5)).toEqual({
    forward: 0.5,
    turn: -0.5,
    up: 1,
  });
});

describe('round trips', () => {
  it('are told of the last ten seconds, each stick once', () => {
    const trips = new RoundTrips();
    for (let n = 0; n < 20; n += 1) {
      trips.sent(n, 1000 * n);
      trips.answered(n, 1000 * n + n);
      trips.answered(n, 1000 * n + 900);
    }
    expect(trips.ofLate(19_019)).toEqual({ answers: 10, p50: 15, p95: 19 });
    expect(trips.ofLate(60_000)).toBeNull();
  });

  it('of a stick that was never sent are none', () => {
    const trips = new RoundTrips();
    trips.answered(5, 100);
    expect(trips.ofLate(100)).toBeNull();
  });
});
