import type { CameraFix } from '../../api/types';

const COUNTS = (count: number, word: string) => `${count} ${word}${count === 1 ? '' : 's'}`;

/** Who found it and how surely, in words. */
export function fixWords(fix: CameraFix, robot: string): { by: string; within: string } {
  const [xx, , , yy, , zz] = fix.covariance_m2;
  const mm = 1000 * Math.sqrt(Math.max(xx, yy, zz, 0));
  const by = `${COUNTS(fix.cameras.length, 'camera')}, ${COUNTS(fix.tags.length, 'tag')}`;
  const less = fix.reason || `${robot}’s tilt is not sure`;
  return {
    by: fix.quality === 'good' ? by : `${by}: position only, ${less}`,
    within: `±${mm < 1 ? '1' : mm.toFixed(0)} mm`,
  };
}
