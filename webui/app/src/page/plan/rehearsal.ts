import type { Rehearsal } from '../../api/types';
import { compact } from '../../text/unit';
import type { Tone } from '../../text/word';

const WORDS: Record<Rehearsal['state'], { text: string; tone: Tone }> = {
  working: { text: 'Being flown by the simulator', tone: 'accent' },
  done: { text: 'Rehearsed', tone: 'ok' },
  failed: { text: 'Failed', tone: 'alarm' },
  skipped: { text: 'Not rehearsed', tone: 'watch' },
};

/** State of a rehearsal; one that did not reach the end is no good news. */
export function rehearsalWord(rehearsal: Rehearsal): { text: string; tone: Tone } {
  if (rehearsal.state === 'done' && rehearsal.completed === false) {
    return { text: 'Did not reach the end', tone: 'alarm' };
  }
  return WORDS[rehearsal.state];
}

/** A few flights scatter by this much about a prediction that is right. */
const SCATTER = 1.25;

/**
 * Whether the predicted uncertainty covers what the rehearsal found, in words.
 *
 * It is about where the robot believes to be; that it strays from the plan and knows it is another
 * thing, which the distances from the plan tell.
 */
export function coverage({
  position_error_m,
  predicted_error_m,
}: Rehearsal): { text: string; isCovered: boolean } | null {
  if (typeof position_error_m !== 'number' || typeof predicted_error_m !== 'number') return null;
  const isCovered = position_error_m <= predicted_error_m * SCATTER;
  const figures = `${compact(position_error_m)} m, predicted ${compact(predicted_error_m)} m`;
  return {
    isCovered,
    text: isCovered
      ? `The predicted uncertainty covers the position error: ${figures}.`
      : `The position error is larger than predicted: ${figures}. The plan is surer than it should be.`,
  };
}
