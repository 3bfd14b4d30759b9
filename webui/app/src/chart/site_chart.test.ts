import { describe, expect, test } from 'vitest';
import { northEast, wgs84 } from '../text/frame';
import { depthAt, depthGrid, isobaths } from './depth_shade';
import { gridOf, roundStep, scaleBar } from './graticule';
import { bearingText, distanceText, geodesic } from './measure';
import {
  affineOf,
  columnOf,
  covers,
  latitudeOf,
  longitudeOf,
  rowOf,
  tilesIn,
  zoomFor,
} from './web_mercator';

const LAKE = { origin_latitude_deg: 42.76, origin_longitude_deg: -84.38 };
const FJORD = { origin_latitude_deg: 62.5, origin_longitude_deg: 179.9 };
const WORLD = {
  west_deg: -180,
  south_deg: -85,
  east_deg: 180,
  north_deg: 85,
  min_zoom: 0,
  max_zoom: 18,
};
const square = (half: number) => ({ north: [-half, half], east: [-half, half] }) as const;

describe('tiles of Web Mercator', () => {
  test('are counted from the antimeridian and the north', () => {
    expect(columnOf(-180, 3)).toBe(0);
    expect(columnOf(180, 3)).toBe(8);
    expect(rowOf(0, 1)).toBeCloseTo(1, 12);
    expect(rowOf(85.0511287798, 4)).toBeCloseTo(0, 6);
    for (const row of [0.5, 3.25, 7]) expect(rowOf(latitudeOf(row, 3), 3)).toBeCloseTo(row, 10);
    for (const column of [0, 2.5, 8]) expect(columnOf(longitudeOf(column, 3), 3)).toBe(column);
  });

  test('have pixels about as large as those of the screen, or the nearest that there are', () => {
    expect(zoomFor(0, 1 / 156543, WORLD)).toBe(0);
    expect(zoomFor(0, 1 / 1222.99, WORLD)).toBe(7);
    expect(zoomFor(60, 1 / 1222.99, WORLD)).toBe(6);
    expect(zoomFor(0, 1000, WORLD)).toBe(18);
  });

  test.each([LAKE, FJORD])('lie within a pixel of where they should, 50 km around', (site) => {
    for (const [half, pixels] of [
      [50_000, 1000],
      [5000, 1000],
      [500, 1000],
    ] as const) {
      const perM = pixels / (2 * half);
      const z = zoomFor(site.origin_latitude_deg, perM, WORLD);
      const tiles = tilesIn(site, square(half), WORLD, z);
      expect(tiles.length).toBeGreaterThan(3);
      for (const tile of tiles) {
        const { right, down, corner, errorM } = affineOf(site, tile);
        expect(errorM * perM).toBeLessThan(1);
        // The middle of the tile, through its straight mapping and through the geodesic.
        const [east, south] = [0, 1].map(
          (i) => corner[i as 0 | 1] + 128 * (right[i as 0 | 1] + down[i as 0 | 1]),
        ) as [number, number];
        const truth = northEast(site, latitudeOf(tile.y + 0.5, z), longitudeOf(tile.x + 0.5, z));
        expect(Math.hypot(-south - truth[0], east - truth[1]) * perM).toBeLessThan(1);
      }
    }
  });

  test('cover the whole sight, over the antimeridian too', () => {
    const z = 9;
    const tiles = tilesIn(FJORD, square(50_000), WORLD, z);
    const keys = new Set(tiles.map(({ x, y }) => `${x % 2 ** z} ${y}`));
    for (const north of [-49_000, 0, 49_000]) {
      for (const east of [-49_000, 0, 49_000]) {
        const place = wgs84(FJORD, north, east);
        const x = Math.floor(columnOf(place.longitude, z)) % 2 ** z;
        expect(keys).toContain(`${x} ${Math.floor(rowOf(place.latitude, z))}`);
      }
    }
  });

  test('are none beyond the edges of a map, and never very many', () => {
    const harbour = {
      ...WORLD,
      west_deg: -84.5,
      east_deg: -84.3,
      south_deg: 42.7,
      north_deg: 42.8,
    };
    expect(covers(LAKE, square(500), harbour)).toBe(true);
    expect(covers(FJORD, square(500), harbour)).toBe(false);
    const x = tilesIn(LAKE, square(50_000), harbour, 12).map((tile) => tile.x);
    expect(Math.min(...x)).toBe(Math.floor(columnOf(-84.5, 12)));
    expect(Math.max(...x)).toBe(Math.floor(columnOf(-84.3, 12)));
    expect(tilesIn(LAKE, square(50_000), WORLD, 18)).toEqual([]);
    const pacific = { ...WORLD, west_deg: 170, east_deg: -170 };
    expect(covers(FJORD, square(50_000), pacific)).toBe(true);
    expect(covers(LAKE, square(50_000), pacific)).toBe(false);
  });
});

describe('the grid of a map', () => {
  const room = { up: 100, across: 60 };

  test('is of round numbers in each notation', () => {
    expect(roundStep(0.0013, 'degrees')).toBeCloseTo(0.002);
    expect(roundStep(0.0013, 'minutes') * 60).toBeCloseTo(0.1);
    expect(roundStep(0.0013, 'seconds') * 3600).toBeCloseTo(5);
    for (const format of ['degrees', 'minutes', 'seconds'] as const) {
      const { across, up } = gridOf(LAKE, square(500), 'geographic', format, room);
      expect(across.length).toBeGreaterThan(2);
      expect(up.length).toBeGreaterThan(2);
      const labels = [...across, ...up].map(({ label }) => label);
      expect(new Set(labels).size).toBe(labels.length);
      expect(labels.join()).not.toContain('60.0');
    }
  });

  test('has lines on their latitude and longitude, curved as they are', () => {
    const { across, up } = gridOf(FJORD, square(50_000), 'geographic', 'minutes', {
      up: 12_000,
      across: 8000,
    });
    for (const line of across) {
      const latitudes = line.points.map(([n, e]) => wgs84(FJORD, n, e).latitude);
      expect(Math.max(...latitudes) - Math.min(...latitudes)).toBeLessThan(1e-9);
    }
    expect(up.some(({ label }) => label.endsWith('W'))).toBe(true);
    expect(up.some(({ label }) => label.endsWith('E'))).toBe(true);
  });

  test('is of metres where degrees are too coarse', () => {
    const tank = gridOf(LAKE, square(2), 'geographic', 'degrees', { up: 0.4, across: 0.3 });
    expect(tank.up.map(({ label }) => label)).toContain('0.5 m E');
    const sea = gridOf(LAKE, square(50_000), 'metres', 'degrees', { up: 1e4, across: 1e4 });
    expect(sea.across.map(({ label }) => label)).toContain('20 km N');
    expect(gridOf(LAKE, square(2), 'none', 'degrees', room)).toEqual({ across: [], up: [] });
  });

  test('comes with a bar of a round length', () => {
    expect(scaleBar(1, 110)).toEqual({ px: 100, text: '100 m' });
    expect(scaleBar(0.01, 110)).toEqual({ px: 100, text: '10 km' });
    expect(scaleBar(300, 110).text).toBe('20 cm');
  });
});

describe('the measuring tool', () => {
  test('tells the geodesic between two places far from the origin', () => {
    // One degree of latitude from 42.0 N on the meridian: 111,060.99 m (GeographicLib).
    const from = northEast(LAKE, 42, -84.1);
    const to = northEast(LAKE, 43, -84.1);
    const way = geodesic(LAKE, from, to);
    expect(way.metres).toBeCloseTo(111_072, -2);
    expect(Math.min(way.bearingDeg, 360 - way.bearingDeg)).toBeLessThan(1e-5);
    expect(geodesic(LAKE, to, from).bearingDeg).toBeCloseTo(180, 5);
  });

  test('writes lengths and bearings as they are spoken', () => {
    expect([0.1234, 45.678, 345.67, 1234.5, 45_678].map(distanceText)).toEqual([
      '0.123 m',
      '45.7 m',
      '345.7 m',
      '1.234 km',
      '45.68 km',
    ]);
    expect([0, 5.04, 359.97].map(bearingText)).toEqual(['000.0°', '005.0°', '000.0°']);
  });
});

describe('the floor of a water', () => {
  const slope = {
    north_m: [0, 10, 100],
    east_m: [0, 200],
    depth_m: [
      [0, 20],
      [1, 21],
      [10, 30],
    ],
  };

  test('is as deep between its lines as they say, and beyond them as at the last', () => {
    expect(depthAt(slope, 5, 0)).toBeCloseTo(0.5);
    expect(depthAt(slope, 55, 100)).toBeCloseTo(15.5);
    expect(depthAt(slope, 500, 500)).toBeCloseTo(30);
  });

  test('is a regular grid from the north-west, of no more points than asked', () => {
    const grid = depthGrid(slope, 41);
    expect([grid.width, grid.height]).toEqual([41, 21]);
    expect(grid.values[0]).toBeCloseTo(10);
    expect(grid.values.at(-1)).toBeCloseTo(20);
    expect(grid.deepest).toBeCloseTo(30);
  });

  test('has lines of equal depth where it is so deep, with their numbers', () => {
    const lines = isobaths(depthGrid(slope, 60));
    expect(lines.map(({ depthM }) => depthM)).toEqual([5, 10, 15, 20, 25]);
    for (const { depthM, pieces, labels } of lines) {
      for (const [north, east] of pieces.flat()) {
        expect(depthAt(slope, north, east)).toBeCloseTo(depthM, 1);
      }
      expect(labels.length).toBeGreaterThan(0);
    }
  });
});
