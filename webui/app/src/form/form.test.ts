import { describe, expect, test } from 'vitest';
import { Problem } from '../api/problem';
import type { JsonObject } from '../api/types';
import { boundsText, fault, parseNumber, parseNumbers, zeroMeaning } from './check';
import { Draft, fieldTitle, nodeAt } from './draft.svelte';
import { formTree, type FormNode, type NumberNode } from './schema';
import { difference, leaves, withValue } from './value';
import { valueText } from './value_text';
import { faultOf } from './own_messages';

const SCHEMA: JsonObject = {
  $defs: {
    Box: {
      type: 'object',
      properties: {
        x_max_m: { type: 'number', title: 'North edge', default: 2.75, unit: 'm' },
        depth_max_m: { type: 'number', default: 0.65, exclusiveMinimum: 0, unit: 'm' },
      },
    },
  },
  type: 'object',
  properties: {
    domain: {
      $ref: '#/$defs/Box',
      title: 'Domain',
      description: 'The water to explore.',
      default: { x_max_m: 460, depth_max_m: 16 },
    },
    glide_angle_rad: {
      type: 'number',
      title: 'Glide angle',
      unit: 'rad',
      display_unit: 'deg',
      exclusiveMinimum: 0,
      exclusiveMaximum: Math.PI / 2,
      default: 0.44,
      advanced: true,
    },
    objective: { type: 'string', enum: ['information_gain', 'ergodic'], default: 'ergodic' },
    seed: { anyOf: [{ type: 'integer', minimum: 0 }, { type: 'null' }], default: null },
    thresholds_m: {
      type: 'array',
      items: { type: 'number', exclusiveMinimum: 0 },
      minItems: 1,
      unit: 'm',
      default: [0.1, 0.2],
    },
    pair: {
      type: 'array',
      prefixItems: [{ type: 'number' }, { type: 'number' }],
      minItems: 2,
      maxItems: 2,
    },
    shape: { anyOf: [{ type: 'string' }, { type: 'number' }] },
    is_reused: { type: 'boolean', default: true },
  },
};

const STORED: JsonObject = {
  domain: { x_max_m: 460, depth_max_m: 16 },
  glide_angle_rad: 0.44,
  objective: 'ergodic',
  seed: null,
  thresholds_m: [0.1, 0.2],
  pair: [1, 2],
  shape: 'round',
  is_reused: true,
};

const tree = formTree(SCHEMA);

function node(...path: string[]): FormNode {
  const found = nodeAt(tree, path);
  if (!found) throw new Error(`no node at ${path.join('.')}`);
  return found;
}

describe('a form tree', () => {
  test('follows references and keeps what stands beside them', () => {
    const domain = node('domain');
    expect(domain.kind).toBe('group');
    expect(domain.title).toBe('Domain');
    expect(domain.help).toBe('The water to explore.');
  });

  test('lets the default of a group speak for its members', () => {
    expect(node('domain', 'depth_max_m').default).toBe(16);
  });

  test('makes a title of a key where the schema has none', () => {
    expect(node('domain', 'depth_max_m').title).toBe('Depth max m');
  });

  test('knows kinds, nulls, advanced fields and lists', () => {
    expect(node('objective').kind).toBe('choice');
    expect(node('seed')).toMatchObject({ kind: 'number', isWhole: true, isNullable: true });
    expect(node('glide_angle_rad')).toMatchObject({ isAdvanced: true, displayUnit: 'deg' });
    expect(node('thresholds_m')).toMatchObject({ kind: 'numbers', unit: 'm', least: 1 });
    expect(node('pair')).toMatchObject({ kind: 'numbers', least: 2, most: 2 });
    expect(node('is_reused').kind).toBe('switch');
    expect(node('shape').kind).toBe('raw');
  });
});

describe('a check', () => {
  test('tells bounds in the unit of the screen', () => {
    const angle = node('glide_angle_rad') as NumberNode;
    expect(fault(angle, 0)).toBe('More than 0 °.');
    expect(fault(angle, 2)).toBe('Less than 90 °.');
    expect(fault(angle, 0.5)).toBeNull();
    expect(boundsText(angle)).toBe('more than 0, less than 90 °');
  });

  test('wants whole numbers, listed choices and enough numbers', () => {
    expect(fault(node('seed'), 1.5)).toBe('A whole number is needed.');
    expect(fault(node('seed'), null)).toBeNull();
    expect(fault(node('objective'), 'fastest')).toBe('Choose one of the list.');
    expect(fault(node('thresholds_m'), [])).toBe('At least 1 numbers are needed.');
    expect(fault(node('thresholds_m'), [0.1, -1])).toBe('Each number: more than 0 m.');
    expect(fault(node('pair'), [1])).toBe('Exactly 2 numbers are needed.');
    expect(fault(node('domain', 'x_max_m'), undefined)).toBe('A value is needed.');
  });

  test.each([
    ['1.5', 1.5],
    [' −3 ', -3],
    ['0,25', 0.25],
    ['.5', 0.5],
    ['1e3', 1000],
    ['1,000.5', null],
    ['12 m', null],
    ['', null],
    ['Infinity', null],
  ])('reads %j as %j', (typed, value) => {
    expect(parseNumber(typed)).toBe(value);
  });

  test('reads lists with commas or spaces', () => {
    expect(parseNumbers('0.1, 0.2;0.3')).toEqual([0.1, 0.2, 0.3]);
    expect(parseNumbers('0.1 x')).toBeNull();
  });
});

describe('a draft', () => {
  test('patches changed members only, however deep', () => {
    const changed = withValue(STORED, ['domain', 'depth_max_m'], 12);
    expect(difference(STORED, changed)).toEqual({ domain: { depth_max_m: 12 } });
    expect(STORED.domain).toEqual({ x_max_m: 460, depth_max_m: 16 });
    expect(difference(STORED, { ...STORED, thresholds_m: [0.1, 0.2] })).toEqual({});
  });

  test('tells what was taken out of a map, however deep', () => {
    const stored = { series: { temperature: { fail_low: 1, spike_fail: 2 }, salinity: {} } };
    expect(difference(stored, { series: { temperature: { fail_low: 1 } } })).toEqual({
      series: { temperature: { spike_fail: null }, salinity: null },
    });
  });

  test('marks what differs from the preset and from what is stored', () => {
    const draft = new Draft(SCHEMA, { ...STORED, glide_angle_rad: 0.5 }, STORED);
    const angle = leaves(draft.tree).find(({ path }) => path[0] === 'glide_angle_rad');
    const depth = leaves(draft.tree).find(({ path }) => path[1] === 'depth_max_m');
    if (!angle || !depth) throw new Error('the schema has both');
    expect(draft.isDefault(angle)).toBe(false);
    expect(draft.isUnsaved(angle)).toBe(false);
    draft.set(depth, 12);
    expect(draft.isUnsaved(depth)).toBe(true);
    expect(draft.isChanged).toBe(true);
    expect(draft.patch).toEqual({ domain: { depth_max_m: 12 } });
    draft.set(depth, 16);
    expect(draft.isChanged).toBe(false);
  });

  test('is not valid while a text is no number', () => {
    const draft = new Draft(SCHEMA, STORED, STORED);
    const depth = leaves(draft.tree).find(({ path }) => path[1] === 'depth_max_m');
    if (!depth) throw new Error('the schema has it');
    draft.setUnreadable(depth, 'A number is needed.');
    expect(draft.isValid).toBe(false);
    expect(draft.error(depth)).toBe('A number is needed.');
    draft.set(depth, 3);
    expect(draft.isValid).toBe(true);
  });

  test('shows refusals beside their fields until these change', () => {
    const draft = new Draft(SCHEMA, STORED, STORED);
    const [depth] = leaves(draft.tree).filter(({ path }) => path[1] === 'depth_max_m');
    const [list] = leaves(draft.tree).filter(({ path }) => path[0] === 'thresholds_m');
    if (!depth || !list) throw new Error('the schema has both');
    draft.refuse(
      new Problem(422, 'Refused', '', [
        { path: ['domain', 'depth_max_m'], message: 'tank floor 1.2 m' },
        { path: ['thresholds_m', '1'], message: 'must ascend' },
        { path: ['unheard_of'], message: 'what is this' },
      ]),
    );
    expect(draft.error(depth)).toBe('tank floor 1.2 m');
    expect(draft.error(list)).toBe('must ascend');
    expect(draft.strays.map(({ message }) => message)).toEqual(['what is this']);
    draft.set(depth, 1);
    expect(draft.error(depth)).toBeNull();
  });

  test('names the fields of a group by their titles', () => {
    const draft = new Draft(SCHEMA, STORED, STORED);
    const message = 'x_max_m must exceed x_min_m';
    draft.refuse(new Problem(422, 'Refused', '', [{ path: ['domain'], message }]));
    const domain = nodeAt(draft.tree, ['domain']);
    expect(domain && draft.error(domain)).toBe('“North edge” must exceed x_min_m');
  });
});

test('a field that means nothing beside the others is not shown, unless it is wrong', () => {
  const needs = (path: readonly string[], value: JsonObject) =>
    path[0] !== 'domain' || value.objective === 'ergodic';
  const draft = new Draft(SCHEMA, { ...STORED, objective: 'ergodic' }, STORED, needs);
  const domain = nodeAt(draft.tree, ['domain']) as FormNode;
  const objective = nodeAt(draft.tree, ['objective']) as FormNode;
  const depth = nodeAt(draft.tree, ['domain', 'depth_max_m']) as FormNode;
  expect(draft.isInUse(domain)).toBe(true);
  draft.set(objective, 'information_gain');
  expect(draft.isInUse(domain)).toBe(false);
  draft.setUnreadable(depth, 'A number is needed.');
  expect(draft.isInUse(domain)).toBe(true);
});

test('a document of another version fills what the form knows of it', () => {
  const draft = new Draft(SCHEMA, STORED, STORED);
  draft.loadKnown({ domain: { depth_max_m: 3 }, forgotten: 7 });
  expect(draft.value).toEqual({
    ...STORED,
    domain: { ...(STORED.domain as JsonObject), depth_max_m: 3 },
  });
  expect(draft.isValid).toBe(true);
});

describe('a field that the station names', () => {
  const tree = formTree(SCHEMA);
  test('has the name that the form gives it', () => {
    expect(fieldTitle(tree, 'domain.x_max_m')).toBe('North edge');
    expect(fieldTitle(tree, 'glide_angle_rad')).toBe('Glide angle');
  });
  test('is written as a person does where the form has none', () => {
    expect(fieldTitle(tree, 'start')).toBe('Start');
    expect(fieldTitle(tree, 'mission.draft_age_s')).toBe('Mission draft age s');
    expect(fieldTitle(undefined, 'start')).toBe('Start');
  });
});

describe('what differs from the defaults', () => {
  const changed: JsonObject = { ...STORED, glide_angle_rad: 0.5, is_reused: false, pair: [3, 4] };

  test('is told of a form whose values were kept from before', () => {
    const draft = new Draft(SCHEMA, changed, STORED);
    expect(draft.departures.map(({ path }) => path[0])).toEqual([
      'glide_angle_rad',
      'pair',
      'is_reused',
    ]);
    expect(new Draft(SCHEMA, STORED, STORED).departures).toEqual([]);
  });

  test('is of no interest where the field means nothing', () => {
    const draft = new Draft(SCHEMA, changed, STORED, ([key]) => key !== 'pair');
    expect(draft.departures.map(({ path }) => path[0])).not.toContain('pair');
  });

  test('is reset at once, but for what another part of the page shows', () => {
    const draft = new Draft(SCHEMA, changed, STORED, () => true, ['pair']);
    draft.setUnreadable(node('glide_angle_rad'), 'A number is needed.');
    draft.resetAll();
    expect(draft.value).toEqual({ ...STORED, pair: [3, 4] });
    expect(draft.isValid).toBe(true);
    expect(draft.stored).toEqual(changed);
    expect(draft.patch).toEqual({ glide_angle_rad: 0.44, is_reused: true });
  });

  test('is read with units, titles and words', () => {
    expect(valueText(node('glide_angle_rad'), Math.PI / 6)).toBe('30°');
    expect(valueText(node('thresholds_m'), [0.1, 0.2])).toBe('0.1, 0.2\u00a0m');
    expect(valueText(node('objective'), 'ergodic')).toBe('Ergodic');
    expect(valueText(node('seed'), null)).toBe('none');
    expect(valueText(node('is_reused'), false)).toBe('off');
  });
});

describe('a 0 that is no number like others', () => {
  test('is told in the words of its help', () => {
    expect(
      zeroMeaning('Longest duration of one round, surfacings included; 0 sets no limit.'),
    ).toBe('0 sets no limit.');
    expect(zeroMeaning('A share of the whole; 0.3 is usual. Above 0 only.')).toBe('');
    expect(zeroMeaning('Energy units of one round.')).toBe('');
  });
});

test('a form says in its own words what its fields lack', () => {
  const field = { title: '', type: 'text', minLength: 10, min: '1', max: '9' };
  const fault = (validity: Partial<ValidityState>, more = {}) =>
    faultOf({ ...field, ...more, validity });
  expect(fault({ valid: true })).toBe('');
  expect(fault({ valid: false, valueMissing: true })).toBe('Fill this in.');
  expect(fault({ valid: false, valueMissing: true }, { type: 'file' })).toBe('Choose a file.');
  expect(fault({ valid: false, tooShort: true })).toBe('At least 10 characters.');
  expect(fault({ valid: false, rangeUnderflow: true })).toBe('At least 1.');
  expect(fault({ valid: false, patternMismatch: true }, { title: 'Lower case only' })).toBe(
    'Lower case only.',
  );
});
