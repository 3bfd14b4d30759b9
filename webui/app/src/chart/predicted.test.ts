import { expect, test } from 'vitest';
import type { Prediction } from '../api/types';
import { predictedMark } from './predicted';

const SAID = Date.parse('2026-06-01T12:00:00Z');
const place = (s: number, north: number, long: number) => ({
  at: new Date(SAID + s * 1000).toISOString(),
  north_m: north,
  east_m: 5,
  depth_m: 0,
  ellipse_m: [long, long / 2] as const,
  ellipse_rad: 0.5,
});
const PREDICTION: Prediction = {
  robot: 'grace-1',
  kind: 'afloat',
  text: '',
  is_silent: true,
  said_at: new Date(SAID).toISOString(),
  age_s: 0,
  now: null,
  path: [place(0, 0, 2), place(100, 10, 4), place(200, 20, 8)],
  widened: 1,
  next_contact: null,
  acts: [],
};

test('a robot that is not heard moves on along its prediction, and its ellipse grows', () => {
  const mark = predictedMark(PREDICTION, SAID + 150_000);
  expect(mark?.at[0]).toBeCloseTo(15);
  expect(mark?.ellipseM[0]).toBeCloseTo(6);
  expect(mark?.way).toEqual([
    [0, 5],
    [10, 5],
    [15, 5],
  ]);
  expect(mark?.label).toBe('grace-1 predicted; heard 2 min ago');
});

test('beyond its end a prediction stays where it ends, and without a path there is none', () => {
  expect(predictedMark(PREDICTION, SAID + 900_000)?.at[0]).toBeCloseTo(20);
  expect(predictedMark({ ...PREDICTION, path: [] }, SAID)).toBeNull();
});
