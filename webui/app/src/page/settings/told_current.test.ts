import { describe, expect, test } from 'vitest';
import { emptyDraft, faultOf, flowOf, levelOf, ofKind, typedOf } from './told_current';

const NOW = Date.parse('2026-05-01T12:00:00Z');

describe('a typed current', () => {
  test('is told as it is typed: cm/s, and whither it goes', () => {
    const level = levelOf({ depth: '5', speed: '20', towards: '90' });
    expect(level.depth_m).toBe(5);
    expect(level.north_m_s).toBeCloseTo(0);
    expect(level.east_m_s).toBeCloseTo(0.2);
    const { speed, towards } = flowOf(level);
    expect(speed).toBeCloseTo(20);
    expect(towards).toBe(90);
  });

  test('goes west at 270 degrees', () => {
    expect(flowOf(levelOf({ depth: '0', speed: '3', towards: '270' })).towards).toBe(270);
  });

  test('holds for as long as was chosen, or always', () => {
    const draft = { ...emptyDraft(), hours: 6 };
    expect(typedOf(draft, NOW).valid_until).toBe('2026-05-01T18:00:00.000Z');
    expect(typedOf({ ...draft, hours: 0 }, NOW).valid_until).toBeNull();
  });

  test('leaves the deviation to the station unless one is typed', () => {
    expect(typedOf(emptyDraft(), NOW)).not.toHaveProperty('std_m_s');
    expect(typedOf({ ...emptyDraft(), std: '4' }, NOW).std_m_s).toBe(0.04);
  });

  test('that cannot be is refused in words', () => {
    const level = { depth: '0', speed: '5', towards: '90' };
    const draft = { ...emptyDraft(), levels: [level] };
    expect(faultOf(draft)).toBe('');
    expect(faultOf({ ...draft, levels: [{ ...level, towards: '725' }] })).toContain('0 to 360');
    expect(faultOf({ ...draft, levels: [{ ...level, speed: 'fast' }] })).toContain('the speed');
    expect(faultOf({ ...draft, std: '0' })).toContain('Give or take');
  });

  test('of several depths begins with two and becomes one again', () => {
    const profile = ofKind(emptyDraft(), 'profile');
    expect(profile.levels).toHaveLength(2);
    expect(ofKind(profile, 'constant').levels).toHaveLength(1);
  });
});
