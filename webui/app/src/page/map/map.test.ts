import { describe, expect, test } from 'vitest';
import type { FieldMap, Samples, ShareAbove } from '../../api/types';
import { fidelityRuns } from '../../chart/path';
import { cutSlice, hasGaps } from '../../chart/slice';
import { samplesOfTrack, slicer, spotsOf } from './spot';
import { middleOf, normalShare, probabilitiesAbove, shareSentence, stepOf } from './threshold';

const MAP: FieldMap = {
  robot: 'mini-1', variable: 'blue_light', title: '', unit: '', scale: 'linear', model: 'single', colour_map: 'viridis', is_derived: false,
  axes: { x_m: [0, 1], y_m: [0, 1], z_m: [0, 1] }, mean: [1, 2, 3, 4, 5, 6, 7, 8], std: [],
  samples: { total: 0, per_fidelity: [] }, updated_at: null, scores: null,
  value_unit: '', site: '', origin_latitude_deg: 0, origin_longitude_deg: 0, shape: [], order: '',
  mask: null, smoothed_samples: 0, models: [], config_version: null, simulation: true, threshold: null,
  carriage: 'still', water_moved: '',
}; // prettier-ignore

test('a slice has no number where there is no water', () => {
  const mask = [true, true, false, true, true, true, true, true];
  const dry = cutSlice({ ...MAP, mask }, MAP.mean, 'depth', 0);
  expect([...dry.values]).toEqual([5, 7, 1, NaN]);
  expect(hasGaps(dry)).toBe(true);
  expect(hasGaps(cutSlice(MAP, MAP.mean, 'depth', 0))).toBe(false);
});

describe('samples on a slice', () => {
  const samples: Samples = {
    robot: 'mini-1', channel: 'blue_light', unit: '', measured_at: [], value: [], decimated: false, pruned: [], is_derived: false,
    north_m: [0.1, 0.9, 0.2, null], east_m: [0.3, 0.4, 0.5, 0], depth_m: [0.1, 0.1, 0.9, 0],
    fidelity: [2, 0, 1, 2], smoothed: [true, false, true, false],
  }; // prettier-ignore

  test('are those that lie nearest to it, the well located on top', () => {
    const spots = spotsOf(samples, slicer([0, 1], 'depth', 0));
    expect(spots).toEqual([
      { across: 0.4, down: 0.9, level: 0, isSmoothed: false },
      { across: 0.3, down: 0.1, level: 2, isSmoothed: true },
    ]);
  });

  test('are none where the station says no places', () => {
    const places = { north_m: null, east_m: null, depth_m: null, fidelity: null, smoothed: null };
    expect(spotsOf({ ...samples, ...places }, slicer([0, 1], 'depth', 0))).toEqual([]);
  });

  test('of a wall have depth downwards', () => {
    expect(slicer([0, 1], 'north', 1)(0.9, 0.4, 0.7)).toEqual({ across: 0.4, down: 0.7 });
    expect(slicer([0, 1], 'east', 0)(0.9, 0.4, 0.7)).toEqual({ across: 0.9, down: 0.7 });
    expect(slicer([0, 1], 'east', 1)(0.9, 0.4, 0.7)).toBeNull();
  });

  test('are the track itself, without its drift, where the station places none', () => {
    const track = {
      robot: 'mini-1', measured_at: [], north_m: [0, 1], east_m: [0, 1], depth_m: [0, 0],
      std_m: [0, 0], fidelity: [2, 2], adrift: [false, true], latitude_deg: [], longitude_deg: [],
      received_at: null, decimated: false, pruned: [], is_derived: false,
    }; // prettier-ignore
    expect(samplesOfTrack(track, 'blue_light').fidelity).toEqual([2, null]);
  });
});

test('drift at the surface is drawn apart from the survey', () => {
  const runs = fidelityRuns({
    north_m: [0, 1, 2, 3],
    east_m: [0, 0, 0, 0],
    fidelity: [2, 2, 2, 2],
    adrift: [false, false, true, true],
  });
  expect(runs.map(({ level }) => level)).toEqual([2, 'drift']);
});

describe('above a value', () => {
  test('the probability is that of the normal distribution', () => {
    for (const [z, share] of [[0, 0.5], [1, 0.841345], [-1.645, 0.04998], [3, 0.99865]] as const) {
      expect(normalShare(z)).toBeCloseTo(share, 5);
    }
  }); // prettier-ignore

  test('a variable seen in logarithms is compared in logarithms', () => {
    const map = { mean: [Math.log(10), 0, null], std: [0.5, 0.5, null], scale: 'log' } as const;
    expect(probabilitiesAbove(map, 10)[0]).toBeCloseTo(0.5, 6);
    expect(probabilitiesAbove(map, 10 * Math.exp(0.5))[0]).toBeCloseTo(0.158655, 5);
    expect(probabilitiesAbove(map, 10)[2]).toBeNull();
    expect(probabilitiesAbove(map, 0).slice(0, 2)).toEqual([1, 1]);
    const linear = { ...map, mean: [5, 6, null], scale: 'linear' } as const;
    expect(probabilitiesAbove(linear, 5)[0]).toBeCloseTo(0.5, 6);
    expect(middleOf({ mean: [1, 2, 3.14159], scale: 'linear' })).toBe(2);
    expect(middleOf({ mean: [Math.log(123)], scale: 'log' })).toBe(120);
  });

  test('colours change at 5, 50 and 95 %', () => {
    expect([0, 0.049, 0.05, 0.49, 0.5, 0.94, 0.95, 1].map(stepOf)).toEqual([
      0, 0, 1, 1, 2, 2, 3, 3,
    ]);
  });

  test('a sentence says how much of the water it is', () => {
    const share = { low: 0.094, high: 0.161, above: 5, unit: 'ug/L' } as ShareAbove;
    expect(shareSentence(share)).toBe('Between 9 and 16 % of the water is above 5 µg/L.');
    expect(shareSentence({ ...share, high: 0.09 })).toContain('About 9 %');
  });
});
