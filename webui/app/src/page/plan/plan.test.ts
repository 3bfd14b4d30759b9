import { describe, expect, test } from 'vitest';
import type { FlightBand, JsonObject, Leg, Rehearsal } from '../../api/types';
import { expectedWays } from '../../chart/path';
import { Draft } from '../../form/draft.svelte';
import { areasOf, currentOf, numberOf } from './config';
import { KeepOutEditor } from './keep_out_editor.svelte';
import { expectedProfile, fidelityBands, nearestPoint, profileOf } from './profile';
import { knowing, rehearsalSentence, rehearsalWord, straying } from './rehearsal';

describe('the profile of a plan', () => {
  const dive = (t: number) =>
    [
      [t, 0, 0, 0, 0.01],
      [t + 10, 0, 0, 2, 0.2],
      [t + 20, 0, 0, 0, 0.01],
    ] as const;

  const leg = (from: number, to: number) => ({
    start_ned: [0, 0, from] as const,
    end_ned: [0, 0, to] as const,
    duration_s: 10,
  });
  const LEGS = [leg(0, 2), leg(2, 0), leg(0, 2), leg(2, 0)];

  test('marks how often the robot comes up, as its account does: not where it begins or swims', () => {
    const swim = [leg(0, 0), ...LEGS, leg(0, 0)];
    expect(profileOf(dive(0), 60, swim).surfacings).toHaveLength(2);
  });

  test('counts the time before every leg that begins at the surface in', () => {
    const { points, surfacings, duration } = profileOf([...dive(0), ...dive(20)], 60, LEGS);
    expect(surfacings).toEqual([30, 60]);
    expect(duration).toBe(60);
    expect(points.map(({ t }) => t)).toEqual([0, 10, 10, 20, 30, 30, 30, 40, 50, 60]);
  });

  test('never runs backwards where the account is shorter than the points', () => {
    const { points, duration } = profileOf(dive(0), 5, LEGS.slice(0, 2));
    expect(duration).toBe(20);
    expect(points.every(({ t }, i) => t >= (points[i - 1]?.t ?? 0))).toBe(true);
  });

  test('of no plan is empty', () => {
    expect(profileOf([], null, [])).toEqual({ points: [], surfacings: [], duration: 0 });
  });

  test('is read at the nearest moment', () => {
    const { points } = profileOf(dive(0), null, []);
    expect(nearestPoint(points, 11)).toBe(1);
  });
});

test('bands of fidelity begin with the best located and end at the top', () => {
  expect(fidelityBands([0.05, 0.12], 0.3)).toEqual([
    { low: 0, high: 0.05, level: 2 },
    { low: 0.05, high: 0.12, level: 1 },
    { low: 0.12, high: 0.3, level: 0 },
  ]);
  expect(fidelityBands([0.05, 0.12], 0.1).map(({ level }) => level)).toEqual([2, 1]);
  expect(fidelityBands([0.1], 0.3).map(({ level }) => level)).toEqual([2, 0]);
});

describe('a rehearsal', () => {
  const rehearsal = (change: Partial<Rehearsal>): Rehearsal => ({
    state: 'done', completed: true, rms_error_m: 0.1, worst_error_m: 0.2, surfacing_error_m: 0.1,
    position_error_m: null, predicted_error_m: null, planned_worst_std_m: null, within_share: null,
    entered: [], runs: null, duration_s: 100, energy: 5, flown: [], message: '', expected: [],
    expected_times_s: [], spread_m: null, nearest: [], broken: [], band: null, safety: null, failed: [], not_rehearsed: '',
    ...change,
  }); // prettier-ignore

  test('tells the account and the summary before sending the same', () => {
    const domain = { x_min_m: 0, x_max_m: 2, y_min_m: 0, y_max_m: 1, depth_max_m: 1 };
    expect(rehearsalSentence(rehearsal({}), domain)).toEqual({
      text: 'Rehearsed well.',
      isGood: true,
    });
    const beside = rehearsalSentence(rehearsal({ rms_error_m: 0.45 }), domain);
    expect(beside.isGood).toBe(false);
    expect(beside.text).toContain('Does it fly the plan? Not well: 0.45 m beside the plan');
    const safe = {
      not_back: 0,
      leaves_water: 0,
      leaves_domain: 0,
      dives_cut: 0,
      touches: [],
      outcomes: [],
    } as unknown as FlightBand;
    const risky = rehearsal({ band: { ...safe, leaves_water: 0.1 } });
    expect(rehearsalSentence(risky, domain)).toEqual({
      text: 'Of the flights of its rehearsal 1 in 10 leaves the water.',
      isGood: false,
    });
    expect(rehearsalSentence(rehearsal({ band: safe }), domain).isGood).toBe(true);
    expect(rehearsalSentence(rehearsal({ completed: false }), domain).isGood).toBe(false);
    expect(rehearsalSentence(rehearsal({ state: 'skipped' }), domain).text).toBe('Not rehearsed.');
    expect(rehearsalSentence(null, domain)).toEqual({ text: '', isGood: true });
  });

  test('that did not reach the end is no good news', () => {
    expect(rehearsalWord(rehearsal({ completed: false })).tone).toBe('alarm');
    expect(rehearsalWord(rehearsal({})).tone).toBe('ok');
    expect(rehearsalWord(rehearsal({ state: 'skipped', completed: null })).text).toBe(
      'Not rehearsed',
    );
  });

  test('says whether the robot strays, and what helps', () => {
    const domain = { x_min_m: 0, x_max_m: 3, y_min_m: 0, y_max_m: 1, depth_max_m: 1 };
    expect(straying(rehearsal({}), domain)).toMatchObject({ isGood: true, advice: '' });
    const far = straying(rehearsal({ rms_error_m: 0.4 }), domain);
    expect(far?.isGood).toBe(false);
    expect(far?.advice).toContain('depth change');
    expect(straying(rehearsal({ rms_error_m: null }), domain)).toBeNull();
  });

  test('is judged by its expected track where it has one', () => {
    const domain = { x_min_m: 0, x_max_m: 3, y_min_m: 0, y_max_m: 1, depth_max_m: 1 };
    const near = straying(rehearsal({ rms_error_m: 0.4, spread_m: 0.15 }), domain);
    expect(near).toMatchObject({ isGood: true, found_m: 0.15 });
    expect(near?.verdict).toContain('beside its expected track');
    expect(straying(rehearsal({ spread_m: 0.3 }), domain)?.isGood).toBe(false);
  });

  test('says when each leg of the expected track begins, the stay at the surface counted', () => {
    const leg = (from: number, to: number) => ({
      start_ned: [0, 0, from] as const, end_ned: [0, 0, to] as const, duration_s: 10,
    }); // prettier-ignore
    const legs = [leg(0, 1), leg(1, 0), leg(0, 1), leg(1, 0)];
    const expected = [0, 1, 1, 0, 0, 1, 1, 0].map((depth) => [0, 0, 0, depth, 0.1] as const);
    const expected_times_s = [[2, 14], [14, 30], [50, 62], [62, 80]] as const; // prettier-ignore
    const found = expectedProfile(rehearsal({ expected, expected_times_s, duration_s: 85 }), legs);
    expect(found.points.map(({ t }) => t)).toEqual([2, 14, 14, 30, 50, 62, 62, 80]);
    expect(found.surfacings).toEqual([30, 80]);
    expect(found.duration).toBe(85);
  });

  test('leads along its expected track leg by leg, where it knows one', () => {
    const legs = (['glide', 'swim'] as const).map((kind) => ({ kind }) as Leg);
    const expected = [0, 1, 2, 3].map((at) => [at, at, 0, 0, 0.1] as const);
    const ways = expectedWays({ legs, rehearsal: rehearsal({ expected }) });
    expect(ways.map(({ kind, points }) => [kind, points.map(([north]) => north)])).toEqual([
      ['glide', [0, 1]],
      ['swim', [2, 3]],
    ]);
    expect(expectedWays({ legs, rehearsal: rehearsal({}) })).toEqual([]);
    expect(expectedWays({ legs, rehearsal: null })).toEqual([]);
  });

  test('says whether the predicted uncertainty covers it, and what helps', () => {
    const covered = { position_error_m: 0.15, predicted_error_m: 0.14 };
    expect(knowing(rehearsal(covered))?.isGood).toBe(true);
    const surprised = knowing(rehearsal({ position_error_m: 0.3, predicted_error_m: 0.1 }));
    expect(surprised?.isGood).toBe(false);
    expect(surprised?.verdict).toContain('0.30 m');
    expect(surprised?.advice).toContain('drift');
    expect(knowing(rehearsal({}))).toBeNull();
  });
});

test('settings are read where they are there and are nothing where they are not', () => {
  const config: JsonObject = { current: { north_m_s: 0.1, east_m_s: -0.2 }, time_budget_s: 60 };
  expect(currentOf(config)).toEqual({ north: 0.1, east: -0.2 });
  const still: JsonObject = { current: { source: 'none', north_m_s: 0.1, east_m_s: -0.2 } };
  expect(currentOf(still)).toEqual({ north: 0, east: 0 });
  expect(numberOf(config, 'time_budget_s')).toBe(60);
  expect(numberOf(config, 'time_budget_s', 'deeper')).toBe(0);
  expect(numberOf(undefined, 'target_std')).toBe(0);
  expect(areasOf({ keep_outs: [{ name: 'a', corners_m: [[1, 2]] }, 'no area'] })).toEqual([
    { name: 'a', corners_m: [[1, 2]] },
  ]);
});

describe('keep-outs', () => {
  const SCHEMA: JsonObject = {
    type: 'object',
    properties: {
      keep_outs: { type: 'array', items: { type: 'object', properties: {} }, default: [] },
    },
  };
  const opened = (stored: JsonObject = { keep_outs: [] }) => {
    const draft = new Draft(SCHEMA, stored, { keep_outs: [] });
    return { draft, editor: new KeepOutEditor(() => draft) };
  };

  test('are drawn corner by corner into the settings that are planned with', () => {
    const { draft, editor } = opened();
    editor.begin();
    editor.click(0, 0);
    editor.click(1.2345, 0);
    editor.click(1, 1);
    expect(editor.canFinish).toBe(true);
    editor.finish();
    expect(draft.patch).toEqual({
      keep_outs: [{ name: 'Keep-out 1', corners_m: [[0, 0], [1.23, 0], [1, 1]] }],
    }); // prettier-ignore
    expect(editor.selected).toBe(0);
  });

  test('of two corners are none', () => {
    const { editor } = opened();
    editor.begin();
    editor.click(0, 0);
    editor.click(1, 0);
    editor.finish();
    expect(editor.areas).toEqual([]);
  });

  test('are moved, named and taken away, and every step is undone', () => {
    const box = { x_min_m: 0, x_max_m: 16, y_min_m: 0, y_max_m: 16, depth_max_m: 1 };
    const { editor } = opened();
    editor.addInTheMiddle(box);
    editor.addInTheMiddle(box);
    expect(editor.areas.map(({ name }) => name)).toEqual(['Keep-out 1', 'Keep-out 2']);
    editor.move(0, 2, 12, 13);
    editor.rename(0, 'Mooring');
    editor.insertAfter(0, 0);
    expect(editor.areas[0]?.name).toBe('Mooring');
    expect(editor.areas[0]?.corners_m[1]).toEqual([8, 7]);
    expect(editor.areas[0]?.corners_m[3]).toEqual([12, 13]);
    editor.remove(1);
    editor.undo();
    editor.undo();
    editor.undo();
    expect(editor.areas).toHaveLength(2);
    expect(editor.areas[0]?.name).toBe('Keep-out 1');
    expect(editor.areas[0]?.corners_m[2]).toEqual([12, 13]);
  });

  test('keep three corners at least', () => {
    const corners = [[0, 0], [1, 0], [1, 1]]; // prettier-ignore
    const { editor } = opened({ keep_outs: [{ name: 'a', corners_m: corners }] });
    editor.removeCorner(0, 1);
    expect(editor.areas[0]?.corners_m).toEqual(corners);
  });

  test('become the area of the survey, and the domain the box around it', () => {
    const numbers = Object.fromEntries(
      ['x_min_m', 'x_max_m', 'y_min_m', 'y_max_m'].map((key) => [key, { type: 'number' }]),
    );
    const schema: JsonObject = {
      type: 'object',
      properties: {
        ...(SCHEMA.properties as JsonObject),
        area: {
          anyOf: [{ type: 'object', properties: { name: { type: 'string' } } }, { type: 'null' }],
        },
        domain: { type: 'object', properties: numbers },
      },
    };
    const corners = [[1, 2], [5, 2], [5, 9]]; // prettier-ignore
    const stored: JsonObject = {
      keep_outs: [{ name: 'Keep-out 1', corners_m: corners }],
      area: null,
      domain: { x_min_m: 0, x_max_m: 20, y_min_m: 0, y_max_m: 20 },
    };
    const draft = new Draft(schema, stored, stored);
    const editor = new KeepOutEditor(() => draft);
    expect(draft.isValid).toBe(true);
    editor.surveyInside(0);
    expect(draft.patch).toEqual({
      keep_outs: [],
      area: { name: 'Survey area', corners_m: corners },
      domain: { x_min_m: 1, x_max_m: 5, y_min_m: 2, y_max_m: 9 },
    });
    expect(editor.surveyed?.corners_m).toEqual(corners);
    editor.surveyAll();
    expect(editor.surveyed).toBeNull();
  });

  test('are not offered by a station that does not know them', () => {
    const draft = new Draft({ type: 'object', properties: {} }, {}, {});
    expect(new KeepOutEditor(() => draft).isKnown).toBe(false);
  });
});
