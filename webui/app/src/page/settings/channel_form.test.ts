import { describe, expect, test } from 'vitest';
import type { CatalogueChannel } from '../../api/types';
import {
  changesOf,
  draftOf,
  faultsByField,
  isFound,
  newChannelOf,
  notNumbers,
} from './channel_form';

const OXYGEN: CatalogueChannel = {
  key: 'dissolved_oxygen',
  title: 'Dissolved oxygen',
  unit: 'mg/L',
  display_unit: null,
  kind: 'field',
  origin: 'delivered',
  is_derived: false,
  derived_from: [],
  wire_number: 4,
  low: 0,
  high: 50,
  scale: 'linear',
  can_map: true,
  standard_name: null,
  colour_map: 'viridis',
  decimals: 2,
  alarms: [],
  help: '',
  switch_words: ['off', 'on'],
  is_retired: false,
  changed: [],
  changed_at: null,
  changed_by: '',
};

describe('the form of a channel', () => {
  test('leaves ends away that nobody typed', () => {
    const draft = { ...draftOf(null), key: ' methane', title: 'Methane', unit: 'nmol/L', low: '0' };
    draft.alarms.warning.high = '500';
    expect(newChannelOf(draft)).toMatchObject({
      key: 'methane',
      low: 0,
      high: null,
      wire_number: null,
      standard_name: null,
      alarms: [{ level: 'warning', low: null, high: 500 }],
    });
  });

  test('tells of a delivered channel only what differs, and nothing that is fixed', () => {
    const draft = draftOf(OXYGEN);
    expect(changesOf(OXYGEN, draft)).toEqual({});
    draft.alarms.critical.low = '2';
    draft.colourMap = 'magma';
    draft.unit = 'umol/L';
    expect(changesOf(OXYGEN, draft)).toEqual({
      colour_map: 'magma',
      alarms: [{ level: 'critical', low: 2, high: null }],
    });
    draft.low = '';
    expect(changesOf(OXYGEN, draft)).toHaveProperty('low', null);
  });

  test('has each refusal beside its field', () => {
    const errors = [
      { path: ['unit'], message: 'is none' },
      { path: ['alarms', '0', 'high'], message: 'too high' },
      { path: ['alarms'], message: 'needs an end' },
    ];
    expect(faultsByField(errors)).toEqual({ unit: 'is none', alarms: 'too high; needs an end' });
  });

  test('is found by words of its name, unit or kind', () => {
    expect(isFound(OXYGEN, '')).toBe(true);
    expect(isFound(OXYGEN, 'oxy mg/l')).toBe(true);
    expect(isFound(OXYGEN, 'salt')).toBe(false);
  });
});

describe('a typed number', () => {
  test('may have a decimal comma', () => {
    const draft = { ...draftOf(OXYGEN), high: '80,5' };
    expect(changesOf(OXYGEN, draft)).toEqual({ high: 80.5 });
    expect(notNumbers(draft)).toEqual({});
  });

  test('that is none is named, and takes no limit away', () => {
    expect(notNumbers({ ...draftOf(OXYGEN), high: 'ten' })).toEqual({
      high: '“ten” is no number',
    });
  });
});
