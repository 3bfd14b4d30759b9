import { describe, expect, test } from 'vitest';
import { reachOf } from '../reach';
import { Draft } from '../../form/draft.svelte';
import { isScenarioField, scenarioWords } from './scenario';

describe('a scenario', () => {
  const straight = ['straight', 'glide_angle_rad'];
  const swim = ['straight', 'swim_speed_m_s'];

  test.each([
    ['diagonal', false, false],
    ['straight_glide', true, false],
    ['level_swim', false, true],
  ])('of %s asks for no numbers that it does not use', (reference, hasAngle, hasSpeed) => {
    const value = { reference };
    expect(isScenarioField(['straight'], value)).toBe(hasAngle || hasSpeed);
    expect(isScenarioField(straight, value)).toBe(hasAngle);
    expect(isScenarioField(swim, value)).toBe(hasSpeed);
    expect(isScenarioField(['duration_s'], value)).toBe(true);
    expect(isScenarioField(['disturbance', 'current_north_m_s'], value)).toBe(true);
    const mapped = { ...value, disturbance: { current_source: 'map' } };
    expect(isScenarioField(['disturbance', 'current_north_m_s'], mapped)).toBe(false);
  });

  test('with exact states has no noise', () => {
    const noise = ['sensing', 'depth_std_m'];
    expect(isScenarioField(noise, { sensing: { exact: true } })).toBe(false);
    expect(isScenarioField(noise, { sensing: { exact: false } })).toBe(true);
    expect(isScenarioField(['sensing', 'exact'], { sensing: { exact: true } })).toBe(true);
  });
});

test('a scenario is told by what differs from its preset', () => {
  const number = (title: string, unit: string, more = {}) => ({
    type: 'number', title, unit, ...more,
  }); // prettier-ignore
  const schema = {
    type: 'object',
    properties: {
      reference: { type: 'string', title: 'Reference', enum: ['diagonal', 'level_swim'] },
      straight: {
        type: 'object',
        title: 'Straight path',
        properties: { swim_speed_m_s: number('Swimming speed', 'm/s') },
      },
      disturbance: {
        type: 'object',
        title: 'Disturbance',
        properties: {
          net_buoyancy_error_kg: number('Net buoyancy error', 'kg', { display_unit: 'g' }),
          current_m_s: number('Current', 'm/s'),
        },
      },
      duration_s: number('Duration', 's'),
    },
  };
  const preset = {
    reference: 'diagonal',
    straight: { swim_speed_m_s: 0.05 },
    disturbance: { net_buoyancy_error_kg: 0, current_m_s: 0 },
    duration_s: 225,
  };
  const scenario = {
    ...preset,
    straight: { swim_speed_m_s: 0.1 },
    disturbance: { net_buoyancy_error_kg: -0.002, current_m_s: 0 },
  };
  expect(scenarioWords(new Draft(schema, preset, preset), scenario)).toEqual([
    'Duration 225 s',
    'Disturbance: net buoyancy error −2 g',
  ]);
});

describe('settings', () => {
  test.each([
    ['controller.pid', {}],
    ['estimator', {}],
    ['anything', { reach: 'none', reach_text: 'Not on board: tried only.' }],
  ])('of %s are said not to be on board', (kind, said) => {
    const reach = reachOf(kind, said);
    expect(reach.isCarried).toBe(false);
    expect(reach.text).toMatch(/^Not on board: /);
  });

  test('that travel with a plan say so in the words of the station', () => {
    const words = 'Reaches the robot with the next plan that is made.';
    expect(reachOf('trim', { reach: 'mission', reach_text: words })).toEqual({
      isCarried: true,
      text: words,
    });
    expect(reachOf('trim', {}).isCarried).toBe(true);
  });
});
