import type { Rehearsal } from '../../api/types';
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

/** Share that a 95 % circle should hold, less what chance allows. */
const COVERED = 0.9;

/** Whether the predicted uncertainty covers what the rehearsal found, in words. */
export function coverage({
  within_share,
  position_error_m,
  predicted_error_m,
}: Rehearsal): { text: string; isCovered: boolean } | null {
  if (typeof within_share === 'number') {
    const percent = `${Math.round(within_share * 100)} %`;
    const isCovered = within_share >= COVERED;
    return {
      isCovered,
      text: isCovered
        ? `The predicted uncertainty covers it: ${percent} of the flight lies in the plan’s 95 % circles.`
        : `Only ${percent} of the flight lies in the plan’s 95 % circles: the plan is surer than it should be.`,
    };
  }
  if (typeof position_error_m !== 'number' || typeof predicted_error_m !== 'number') return null;
  const isCovered = position_error_m <= predicted_error_m * 1.1;
  return {
    isCovered,
    text: isCovered
      ? 'The position error stays within what the plan predicts.'
      : 'The position error is larger than the plan predicts.',
  };
}
