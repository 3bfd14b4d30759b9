import { describe, expect, test } from 'vitest';
import { withDomain, withKeepOut, withPlace } from './water_part';
import type { ReadArea, ReadMark, WaterDocument } from './water_part';

const BOX = { x_min_m: 0, x_max_m: 500, y_min_m: 0, y_max_m: 400, depth_max_m: 20 };
const LAKE = {
  water: BOX,
  domain: { ...BOX, depth_max_m: 15 },
  keep_outs: [{ name: 'reeds', corners_m: [] }],
  places: [],
} as unknown as WaterDocument;
const AREA = {
  number: 2,
  name: 'reeds',
  role: 'outline',
  corners_m: [
    [100, -50],
    [300, 50],
    [200, 250],
  ],
} as unknown as ReadArea;

describe('an area of a plan file', () => {
  test('becomes a keep-out under a name that is free', () => {
    const { keep_outs } = withKeepOut(LAKE, AREA);
    expect(keep_outs.map(({ name }) => name)).toEqual(['reeds', 'reeds 2']);
    expect(keep_outs[1]?.corners_m).toEqual(AREA.corners_m);
    const nameless = withKeepOut(LAKE, { ...AREA, name: ' ' });
    expect(nameless.keep_outs[1]?.name).toBe('area 2');
  });

  test('becomes the domain by its box, as far as that lies in the water', () => {
    expect(withDomain(LAKE, AREA)?.domain).toEqual({
      x_min_m: 100,
      x_max_m: 300,
      y_min_m: 0,
      y_max_m: 250,
      depth_max_m: 15,
    });
    const far = AREA.corners_m.map(([north, east]) => [north, east + 900] as const);
    expect(withDomain(LAKE, { ...AREA, corners_m: far })).toBeNull();
  });
});

test('a mark of a plan file becomes a landmark where it lies', () => {
  const mark: ReadMark = {
    name: '',
    kind: 'rally',
    place_deg: [42.76, -84.37],
    place_m: [120, 80],
    note: '',
  };
  expect(withPlace(LAKE, mark).places).toEqual([
    expect.objectContaining({ name: 'rally', kind: 'landmark', north_m: 120, east_m: 80 }),
  ]);
});
