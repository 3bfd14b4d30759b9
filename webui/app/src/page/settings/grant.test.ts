import { describe, expect, it } from 'vitest';
import { asNew, rightsInWords } from './grant';

describe('rights in words', () => {
  it('names the role for all robots first, then chosen ones', () => {
    const grants = asNew([
      { role: 'pilot', robot: 'mini-1', group: null },
      { role: 'viewer', robot: null, group: 'lake' },
    ]);
    expect(rightsInWords('viewer', grants)).toBe(
      'Viewer of all robots, Pilot of mini-1, Viewer of group lake',
    );
  });

  it('says that somebody may do nothing', () => {
    expect(rightsInWords('none', [])).toBe('Nothing');
  });
});
