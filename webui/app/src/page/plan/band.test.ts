import { describe, expect, it } from 'vitest';

import type { FlightBand } from '../../api/types';
import {
  bandCurves,
  chances,
  chanceSentence,
  drawnUntil,
  neverText,
  ofFlights,
  oneIn,
} from './band';

type Row = FlightBand['over_time'][number];
const row = (time: number, charge: readonly [number, number, number]): Row => [
  ...([time, 0, 0, 0, 0, 0, 0, 1, 2, 3] as const),
  ...charge,
  1,
];
const band: FlightBand = {
  level: 0.9,
  along: [
    [0, 10, 30, 0, 2, 0, 3, 0, 1, 1, 1.5, 0.8, 0.4, 0.3, 1],
    [0, 20, 60, 0, 2, 0, 3, 0, 1, 1, 1.5, 1.6, 0.4, 0.3, 1],
  ],
  over_time: [row(0, [1, 1, 1]), row(100, [0.8, 0.85, 0.9])],
  surfacings: [],
  battery_end: [0.8, 0.85, 0.9],
  duration_s: [90, 100, 110],
  worst_std_m: [0.1, 0.2, 0.3],
  leaves_water: 0,
  leaves_domain: 0.5,
  touches: [{ name: 'reeds', share: 0.25 }],
  not_back: 0.015,
  outcomes: [
    { name: 'ran out of time', share: 0.015 },
    { name: 'flew the whole mission', share: 0.985 },
  ],
  dives_cut: 0,
};
const safe: FlightBand = { ...band, touches: [], not_back: 0, leaves_domain: 0 };

describe('the band of a rehearsal', () => {
  it('has depth, distance and charge along time', () => {
    const curves = bandCurves(band);
    expect(curves.map(({ title }) => title)).toEqual(['Depth', 'Beside the track', 'Charge']);
    expect(curves.map(({ moments }) => moments.at(-1))).toEqual([
      { t: 100, values: [1, 2, 3] },
      { t: 60, values: [0, 1.6, 1.6] },
      { t: 100, values: [80, 85, 90] },
    ]);
    expect(bandCurves({ ...band, along: [], over_time: [] })).toEqual([]);
  });

  it('is drawn until twice the time of the middle flight, and says who goes on', () => {
    expect(drawnUntil(band)).toEqual({ end: 110, on: 0 });
    expect(drawnUntil({ ...band, duration_s: [20, 40, 500] })).toEqual({ end: 80, on: 1 });
  });

  it('tells chances as one would say them, and of how many flights', () => {
    const told = chances(band).map(({ what, share }) => [
      what,
      oneIn(share),
      ofFlights(share, 200),
    ]);
    expect(told).toEqual([
      ['Does not come back', '1 in 67', '3 of 200'],
      ['Leaves the water', 'none', 'of 200'],
      ['Enters reeds', '3 in 10', '50 of 200'],
      ['Cuts a dive short', 'none', 'of 200'],
      ['Leaves the surveyed box', '5 in 10', '100 of 200'],
    ]);
    expect([0.05, 0.96, 1].map(oneIn)).toEqual(['1 in 20', 'nearly all', 'all']);
    expect(chances(band)[0]?.help).toContain('99 % flew the whole mission, 1.5 % ran out of time');
  });

  it('takes none of so many flights for no proof', () => {
    expect(neverText(200)).toContain('fewer than 1.5 %');
    expect(neverText(24)).toContain('fewer than 12 %');
  });

  it('is told in a line', () => {
    expect(chanceSentence(band, 200)).toBe(
      'Of 200 flights ahead 1 in 67 does not come back, 3 in 10 enter reeds, ' +
        '5 in 10 leave the surveyed box.',
    );
    expect(chanceSentence(safe, 200)).toBe('In 200 flights ahead nothing went wrong.');
  });
});
