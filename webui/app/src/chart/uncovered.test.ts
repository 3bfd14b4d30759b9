import { describe, expect, it } from 'vitest';
import { uncovered } from './uncovered';

const size = { width: 40, height: 12 };

describe('names on a map', () => {
  it('give way to an earlier one that they would cover, and to no other', () => {
    const boxes = [
      { left: 0, top: 0, ...size },
      { left: 39, top: 11, ...size },
      { left: 40, top: 0, ...size },
      { left: 0, top: 12, ...size },
    ];
    const shown = uncovered(boxes.map((box) => [box]));
    expect(shown).toEqual([boxes[0], null, boxes[2], boxes[3]]);
  });

  it('do not give way to one that is hidden itself', () => {
    const boxes = [0, 30, 60].map((left) => ({ left, top: 0, ...size }));
    expect(uncovered(boxes.map((box) => [box]))).toEqual([boxes[0], null, boxes[2]]);
  });

  it('move to another place before they are hidden', () => {
    const [right, left, below] = [0, -64, -20].map((at) => ({ left: at, top: 0, ...size }));
    if (!right || !left || !below) throw new Error('there are three places');
    below.top = 14;
    const all = [right, left, below];
    expect(uncovered([all, all, all, all])).toEqual([right, left, below, null]);
    expect(uncovered([all, all], [right])).toEqual([left, below]);
  });
});
