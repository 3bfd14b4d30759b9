import { describe, expect, it } from 'vitest';
import type { DiveFacts } from '../../../api/types';
import { filmPath, pace, stretchesOf } from './film';

const BEGIN = Date.parse('2026-11-21T04:00:00Z');
const MINUTE = 60_000;

function dive(number: number, from: number, to: number): DiveFacts {
  return {
    number,
    begin_at: new Date(BEGIN + from * MINUTE).toISOString(),
    end_at: new Date(BEGIN + to * MINUTE).toISOString(),
    duration_s: (to - from) * 60,
    depth_m: 12.34,
    distance_m: null,
    energy_j: null,
    legs: 2,
    samples: 10,
  };
}

describe('what can become a film', () => {
  const bounds = [BEGIN, BEGIN + 60 * MINUTE] as const;
  const dives = [dive(1, 1, 10), dive(2, 12, 20)];

  it('is first the loop, then the dive at the cursor, and all of it last', () => {
    const loop = [BEGIN + MINUTE, BEGIN + 2 * MINUTE] as const;
    const found = stretchesOf(BEGIN + 15 * MINUTE, bounds, loop, dives);
    expect(found.map(({ key }) => key)).toEqual(['loop', 'dive 2', 'around', 'dive 1', 'all']);
    expect(found[1]?.title).toBe('Dive 2, 04:12:00Z, 12.3 m');
  });

  it('ends where the deployment does, and is never nothing', () => {
    const found = stretchesOf(BEGIN + MINUTE, bounds, null, []);
    expect(found[0]?.range).toEqual([BEGIN, BEGIN + 6 * MINUTE]);
    const after = [bounds[1] + MINUTE, bounds[1] + 2 * MINUTE] as const;
    expect(stretchesOf(BEGIN, bounds, after, []).map(({ key }) => key)).not.toContain('loop');
  });

  it('says how fast it runs', () => {
    expect(pace([BEGIN, BEGIN + 10 * MINUTE], 30)).toBe('20 times as fast as life');
    expect(pace([BEGIN, BEGIN + MINUTE], 120)).toBe('0.5 times as fast as life');
  });

  it('is fetched by its name', () => {
    expect(filmPath('mini-1', '0a')).toBe('/api/robots/mini-1/films/0a');
  });
});
