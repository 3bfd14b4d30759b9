import { describe, expect, it } from 'vitest';
import { readGeoJson } from './geojson_layer.svelte';

const feature = (type: string, coordinates: unknown, properties = {}) => ({
  type: 'Feature',
  properties,
  geometry: { type, coordinates },
});

describe('a GeoJSON layer', () => {
  it('has vessels as points with their names', () => {
    const found = readGeoJson({
      type: 'FeatureCollection',
      features: [feature('Point', [-84.4, 42.7], { mmsi: 366123456 })],
    });
    expect(found).toEqual([{ name: '366123456', lines: [[[-84.4, 42.7]]], isArea: false }]);
  });

  it('has every part of areas and lines', () => {
    const ring = [
      [0, 0],
      [1, 0],
      [1, 1],
      [0, 0],
    ];
    expect(readGeoJson(feature('MultiPolygon', [[ring], [ring]]))).toHaveLength(2);
    expect(readGeoJson(feature('LineString', ring))[0]?.isArea).toBe(false);
  });

  it('is refused with the number of the feature that is wrong', () => {
    const broken = feature('Point', [500000, 4700000]);
    const document = { type: 'FeatureCollection', features: [feature('Point', [1, 1]), broken] };
    expect(() => readGeoJson(document)).toThrow('feature 2 has a corner');
    expect(() => readGeoJson(feature('Circle', [1, 1]))).toThrow('feature 1 has no geometry');
    expect(() => readGeoJson({ type: 'FeatureCollection', features: [] })).toThrow('no features');
    expect(() => readGeoJson('a')).toThrow();
  });
});
