import { describe, expect, it } from 'vitest';

import { hasLegs } from './trial.svelte';

const leg = (kind: string, ...end: number[]) => ({ kind, start_ned: [0, 0, 0], end_ned: end });
const legs = [leg('glide', 10, 0, 5), leg('glide', 20, 0, 0)];

describe('a design that was tried', () => {
  it('has the legs of its plan but for what rounding leaves', () => {
    const rounded = [leg('glide', 10.004, 0, 5), leg('glide', 20, 0, 0)];
    expect(hasLegs({ legs }, { legs: rounded })).toBe(true);
  });

  it('has others once one is moved, of another kind or missing', () => {
    const moved = [leg('glide', 10, 0.1, 5), leg('glide', 20, 0, 0)];
    const swum = [leg('swim', 10, 0, 5), leg('glide', 20, 0, 0)];
    for (const other of [moved, swum, legs.slice(0, 1)]) {
      expect(hasLegs({ legs }, { legs: other })).toBe(false);
    }
  });
});
