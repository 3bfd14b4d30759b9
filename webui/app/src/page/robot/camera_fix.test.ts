import { describe, expect, it } from 'vitest';
import type { CameraFix } from '../../api/types';
import { DRAWN_S, fixMark } from '../../chart/camera_fix';
import { fixWords } from './camera_fix_word';

const FIX = {
  robot: 'mini-1',
  measured_at: '2026-11-22T15:04:05.000Z',
  ned_m: [1.4, 0.7, 0.5],
  covariance_m2: [4e-6, 0, 0, 1e-6, 0, 9e-6],
  cameras: ['tank-1', 'tank-2'],
  tags: [0],
  quality: 'good',
  reason: '',
} as unknown as CameraFix;
const AT = Date.parse(FIX.measured_at);

describe('a fix by cameras', () => {
  it('is drawn where they saw the robot, with its ellipse and its age', () => {
    const [mark] = fixMark(FIX, AT + 2500);
    expect(mark?.at).toEqual([1.4, 0.7]);
    expect(mark?.ellipseM[0]).toBeCloseTo(2.447 * 0.002, 5);
    expect(mark?.ellipseRad).toBeCloseTo(0);
    expect(mark?.label).toBe('cameras, 2 s ago');
  });

  it('is drawn no longer once it is old', () => {
    expect(fixMark(FIX, AT + 1000 * DRAWN_S + 1)).toEqual([]);
    expect(fixMark(null, AT)).toEqual([]);
  });

  it('says who found it, how surely, and what it lacks', () => {
    expect(fixWords(FIX, 'mini-1')).toEqual({ by: '2 cameras, 1 tag', within: '±3 mm' });
    const poor = { ...FIX, quality: 'position_only', reason: 'one tag alone' } as CameraFix;
    expect(fixWords(poor, 'mini-1').by).toBe('2 cameras, 1 tag: position only, one tag alone');
  });
});
