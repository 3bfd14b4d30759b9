import { describe, expect, it } from 'vitest';
import { uncovered } from './uncovered';

describe('names on a map', () => {
  it('give way to an earlier one that they would cover, and to no other', () => {
    const size = { width: 40, height: 12 };
    const boxes = [
      { left: 0, top: 0, ...size },
      { left: 39, top: 11, ...size },
      { left: 40, top: 0, ...size },
      { left: 0, top: 12, ...size },
    ];
    expect(uncovered(boxes)).toEqual([true, false, true, true]);
  });

  it('do not give way to one that is hidden itself', () => {
    const size = { width: 40, height: 12 };
    const boxes = [0, 30, 60].map((left) => ({ left, top: 0, ...size }));
    expect(uncovered(boxes)).toEqual([true, false, true]);
  });
});
