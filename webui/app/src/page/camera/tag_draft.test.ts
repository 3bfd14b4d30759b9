import { describe, expect, it } from 'vitest';
import type { TagSetBody } from '../../api/types';
import {
  bodyOf,
  cellFault,
  draftOf,
  freeIds,
  nextRow,
  readFile,
  sheetsOf,
  usualBundle,
} from './tag_draft';

const TAG = {
  id: 100,
  size_m: 0.12,
  position_m: [1.25, -0.5, 1.2] as [number, number, number],
  roll_deg: 0,
  pitch_deg: 90,
  heading_deg: -45,
  position_std_m: null,
  angle_std_deg: 0.3,
};
const BODY: TagSetBody = {
  layout: { tags: [TAG] },
  bundles: [{ robot: 'mini-1', tags: [{ ...TAG, id: 0 }] }],
};

describe('a table of tags', () => {
  it('that nobody changed is what the station told', () => {
    expect(bodyOf(draftOf(BODY))).toEqual({ body: BODY, faults: {} });
  });

  it('says by path what is missing and what is no number', () => {
    const draft = draftOf(BODY);
    Object.assign(draft.layout[0] ?? {}, { y: '' });
    Object.assign(draft.bundles[0]?.tags[0] ?? {}, { size: 'ten' });
    expect(bodyOf(draft).faults).toEqual({
      'layout.tags.0.position_m.1': 'Missing.',
      'bundles.0.tags.0.size_m': 'No number.',
    });
  });

  it('shows a refusal of a whole position at each of its numbers', () => {
    const faults = { 'layout.tags.0.position_m': 'are not three numbers' };
    expect(cellFault(faults, 'layout.tags.0', 'position_m.2')).toBe('are not three numbers');
    expect(cellFault(faults, 'layout.tags.0', 'size_m')).toBe('');
  });

  it('goes on with the next free id', () => {
    const { layout } = draftOf({ ...BODY, layout: { tags: [TAG, { ...TAG, id: 101 }] } });
    expect(nextRow(layout, 100)).toMatchObject({ id: '102', size: '0.12', x: '' });
  });

  it('gives each robot three ids of its own', () => {
    const { bundles } = draftOf(BODY);
    expect(freeIds(bundles)).toBe(3);
    const { body, faults } = bodyOf({ layout: [], bundles: [usualBundle('grace-1', 3)] });
    expect(faults).toEqual({});
    expect(body.bundles[0]?.tags.map(({ id, roll_deg }) => [id, roll_deg])).toEqual([
      [3, 0],
      [4, -45],
      [5, 45],
    ]);
  });
});

describe('sheets to print', () => {
  it('are one for each size, and leave out what is no plate yet', () => {
    const { layout } = draftOf({
      ...BODY,
      layout: { tags: [TAG, { ...TAG, id: 101 }, { ...TAG, id: 102, size_m: 0.1 }] },
    });
    expect(sheetsOf([...layout, { ...nextRow(layout, 100), size: '' }])).toEqual([
      { path: '/api/tags/sheets.pdf?ids=100,101&size_m=0.12', title: 'Print 2 plates of 120 mm' },
      { path: '/api/tags/sheets.pdf?ids=102&size_m=0.1', title: 'Print the plate of 100 mm' },
    ]);
  });
});

describe('a file with tags', () => {
  it('of one robot leaves all others', () => {
    const file = JSON.stringify({ robot: 'grace-1', tags: [{ ...TAG, id: 3 }] });
    const { layout, bundles } = readFile(file, draftOf(BODY));
    expect(layout).toHaveLength(1);
    expect(bundles.map(({ robot }) => robot)).toEqual(['mini-1', 'grace-1']);
  });

  it('of a tank leaves the robots', () => {
    const { layout, bundles } = readFile('{"tags": []}', draftOf(BODY));
    expect([layout.length, bundles.length]).toEqual([0, 1]);
  });

  it('of a site is all', () => {
    const read = bodyOf(readFile(JSON.stringify(BODY), { layout: [], bundles: [] }));
    expect(read.body).toEqual(BODY);
  });

  it('that is none says why', () => {
    expect(() => readFile('[]', draftOf(BODY))).toThrow('no object');
    expect(() => readFile('{"tags": [{"id": 1}]}', draftOf(BODY))).toThrow('tags 0');
  });
});
