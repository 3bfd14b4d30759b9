import { describe, expect, it } from 'vitest';

import type { FlightBand } from '../../api/types';
import { bandEllipses, bandPicture, chances, likely, LOW } from './band';

type Row = FlightBand['over_time'][number];
const row = (time: number, charge: readonly [number, number, number]): Row => [
  ...([time, 0, 0, 0, 0, 0, 0, 0, 0.5, 1] as const),
  ...charge,
  1,
];
const band: FlightBand = {
  level: 0.9,
  along: [[0, 10, 30, 0, 2, 0, 3, 0, 1, 1, 1.5, 0.8, 0.4, 0.3, 1]],
  over_time: [row(0, [1, 1, 1]), row(100, [0.8, 0.85, 0.9])],
  surfacings: [],
  battery_end: [0.8, 0.85, 0.9],
  duration_s: [90, 100, 110],
  worst_std_m: [0.1, 0.2, 0.3],
  leaves_water: 0,
  leaves_domain: 0.5,
  touches: [{ name: 'reeds', share: 0.25 }],
  not_back: 0.015,
  outcomes: [{ name: 'flew the whole mission', share: 0.985 }],
  dives_cut: 0,
};

describe('the band of a rehearsal', () => {
  it('has an ellipse for each place along the legs', () => {
    expect(bandEllipses(band)).toEqual([
      { north: 1, east: 1.5, longM: 0.8, shortM: 0.4, directionRad: 0.3 },
    ]);
    expect(bandEllipses(null)).toEqual([]);
  });

  it('is drawn between its low and its high along time', () => {
    const picture = bandPicture(band.over_time, LOW.charge, false);
    expect(picture).toEqual({
      area: 'M0.0000 0.0000L1.0000 0.5000L1.0000 1.0000L0.0000 0.0000Z',
      middle: 'M0.0000 0.0000L1.0000 0.7500',
      least: 0.8,
      most: 1,
    });
    expect(bandPicture(band.over_time.slice(0, 1), LOW.charge, false)).toBeNull();
  });

  it('tells chances by as many flights as there were', () => {
    expect(chances(band).map((each) => [each.what, likely(each.share, 200)])).toEqual([
      ['Not back as planned', '1.5 %'],
      ['Leaves the water', 'below 0.5 %'],
      ['In reeds', '25 %'],
      ['A dive cut short', 'below 0.5 %'],
    ]);
  });
});
