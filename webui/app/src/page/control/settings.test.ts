import { describe, expect, test } from 'vitest';
import { reachOf } from '../reach';
import { isScenarioField } from './scenario';

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
  });

  test('with exact states has no noise', () => {
    const noise = ['sensing', 'depth_std_m'];
    expect(isScenarioField(noise, { sensing: { exact: true } })).toBe(false);
    expect(isScenarioField(noise, { sensing: { exact: false } })).toBe(true);
    expect(isScenarioField(['sensing', 'exact'], { sensing: { exact: true } })).toBe(true);
  });
});

describe('settings', () => {
  test.each([
    ['controller.pid', undefined],
    ['estimator', undefined],
    ['anything', 'station'],
  ])('of %s (%s) are said not to reach the robot', (kind, said) => {
    const reach = reachOf(kind, said, 'mini-1');
    expect(reach.isCarried).toBe(false);
    expect(reach.text).toBe('Kept at the station, not carried to mini-1');
    expect(reach.outcome).toBe('mini-1 is not told.');
  });

  test('that travel with a plan hold from the next one on', () => {
    expect(reachOf('trim', undefined, 'mini-1')).toMatchObject({ isCarried: true, text: '' });
    expect(reachOf('controller.pid', 'plan', 'mini-1').outcome).toMatch('next plan');
  });
});
