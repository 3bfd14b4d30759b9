import { describe, expect, test } from 'vitest';
import { PLAIN_MANNER, PLAIN_SURFACING, type Content, type Design } from './document';
import { askedFault, candidatesOf, parametersOf, shownIn } from './numbers';

function design(content: Content): Design {
  return { content, manner: PLAIN_MANNER, surfacing: PLAIN_SURFACING };
}

/** What a JSON pointer leads to. */
function found(document: unknown, path: string): unknown {
  return path
    .split('/')
    .slice(1)
    .reduce((inner, step) => (inner as Record<string, unknown>)[step], document);
}

const MOORING = design({
  kind: 'mooring',
  place: { north_m: 10, east_m: -4 },
  duration_s: 5400,
});

describe('numbers of a design', () => {
  test('stand where their paths lead, whatever is drawn', () => {
    const rule = { channel: 'oxygen', side: 'below', value: 120 } as const;
    const drawn = { ...MOORING, surfacing: { ...PLAIN_SURFACING, on_value: [rule] } };
    const candidates = candidatesOf(drawn);
    expect(candidates.map(({ key }) => key)).toContain('duration_s');
    expect(new Set(candidates.map(({ key }) => key)).size).toBe(candidates.length);
    for (const { paths, value } of candidates) {
      for (const path of paths) expect(found(drawn, path)).toBe(value);
    }
    expect(candidates.map(({ label }) => label)).toContain('East of the place');
    expect(candidates.map(({ label }) => label)).toContain('Comes up if oxygen is below');
  });

  test('that several waypoints say alike are asked for once', () => {
    const at = (deep_m: number | null) => ({ north_m: 0, east_m: 0, name: '', deep_m });
    const way = design({
      kind: 'waypoints',
      waypoints: [at(3), at(null), at(3), at(7)],
      returns: false,
    });
    const deep = candidatesOf(way).filter(({ key }) => key.startsWith('deep_m_of'));
    expect(deep.map(({ label }) => label)).toEqual([
      'Deep turn of 2 waypoints',
      'Deep turn of waypoint 4',
    ]);
    expect(deep[0]?.paths).toEqual(['/content/waypoints/0/deep_m', '/content/waypoints/2/deep_m']);
  });

  test('become parameters in the units of the document', () => {
    const asked = { duration_s: { title: ' How long ', usual: null, low: 600, high: 7200 } };
    expect(parametersOf(candidatesOf(MOORING), asked)).toEqual([
      {
        key: 'duration_s',
        title: 'How long',
        unit: 's',
        default: null,
        low: 600,
        high: 7200,
        paths: ['/content/duration_s'],
      },
    ]);
  });

  test('are refused with limits that cannot be met, in units of the screen', () => {
    const one = { title: 'Duration', usual: 60, low: 600, high: null };
    expect(askedFault(one, 's')).toBe('The usual value, 1 min, is less than the least, 10 min.');
    expect(askedFault({ ...one, usual: null, high: 300 }, 's')).toContain('exceeds the most');
    expect(askedFault({ ...one, usual: null }, 's')).toBe('');
    expect(askedFault({ ...one, title: ' ' }, 's')).toBe('It needs a name.');
    expect(shownIn('rad').factor * Math.PI).toBeCloseTo(180);
  });
});
