import { expect, test } from 'vitest';
import type { FlowArrow } from '../api/types';
import { arrowLines, ellipseLine, scaleOf, told } from './flow_arrow';

function arrow(north: number, east: number, isTold = true): FlowArrow {
  return {
    north_m: 100,
    east_m: 50,
    velocity_ne_m_s: [north, east],
    std_ne_m_s: [0.01, 0.01],
    ellipse_m_s: [0.02, 0.02],
    ellipse_rad: 0,
    is_told: isTold,
    is_sure: true,
  };
}

test('the strongest current that is told does not reach the next arrow', () => {
  const arrows = [arrow(0.03, 0.04), arrow(0.01, 0), arrow(2, 0, false)];
  expect(told(arrows)).toHaveLength(2);
  const scale = scaleOf(arrows, 30);
  expect(scale * 0.05).toBeCloseTo(27);
  expect(scaleOf([arrow(0, 0)], 30)).toBe(0);
});

test('an arrow begins at its place and points where the water goes', () => {
  const [shaft, head] = arrowLines(arrow(0.05, 0), 400);
  expect(shaft).toEqual([
    [100, 50],
    [120, 50],
  ]);
  expect(head?.[1]).toEqual([120, 50]);
  expect(head?.[0]?.[0]).toBeLessThan(120);
});

test('an ellipse reaches its half axes in its own direction', () => {
  const line = ellipseLine(10, 20, [4, 1], Math.PI / 2);
  const easts = line.map(([, east]) => east);
  const norths = line.map(([north]) => north);
  expect(Math.max(...easts)).toBeCloseTo(24);
  expect(Math.max(...norths)).toBeCloseTo(11);
});
