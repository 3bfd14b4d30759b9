import { describe, expect, test } from 'vitest';
import { STEPS, cardPlace, type Box } from './steps';

const CARD = { width: 344, height: 230 };

function overlap(at: { left: number; top: number }, anchor: Box): boolean {
  return (
    at.left < anchor.left + anchor.width &&
    anchor.left < at.left + CARD.width &&
    at.top < anchor.top + anchor.height &&
    anchor.top < at.top + CARD.height
  );
}

test('the tour has five steps, and each names the page it is on first', () => {
  expect(STEPS).toHaveLength(5);
  expect(STEPS.map(({ title }) => title.split(':')[0])).toEqual([
    'Fleet',
    'Robot',
    'Surface now',
    'Plan',
    'Log',
  ]);
});

describe.each([
  ['a desk', 1600, 950],
  ['a tablet', 820, 1180],
  ['a phone', 360, 780],
])('on %s', (_, width, height) => {
  const view = { width, height };

  test.each([
    ['at the top', { left: 10, top: 50, width: 300, height: 60 }],
    ['at the bottom', { left: 10, top: height - 120, width: 300, height: 100 }],
    ['at the right edge', { left: width - 150, top: 60, width: 140, height: 60 }],
    ['over the whole width', { left: 0, top: 150, width, height: 200 }],
  ])('the card covers nothing of what it explains %s, and is inside of the window', (_, anchor) => {
    const at = cardPlace(anchor, CARD, view);
    expect(overlap(at, anchor)).toBe(false);
    expect(at.left).toBeGreaterThanOrEqual(0);
    expect(at.top).toBeGreaterThanOrEqual(0);
    expect(at.left + CARD.width).toBeLessThanOrEqual(width);
    expect(at.top + CARD.height).toBeLessThanOrEqual(height);
  });

  test('words without a place stand inside of the window', () => {
    const at = cardPlace(null, CARD, view);
    expect(at.top + CARD.height).toBeLessThanOrEqual(height);
    expect(at.left).toBeGreaterThanOrEqual(0);
  });
});
