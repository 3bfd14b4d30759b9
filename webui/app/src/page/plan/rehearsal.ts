import type { Box, Rehearsal } from '../../api/types';
import { compact } from '../../text/unit';
import { badChances } from './band';
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
    return { text: 'Cut short before its end', tone: 'alarm' };
  }
  return WORDS[rehearsal.state];
}

/** One answer of a rehearsal: a question, the figure, and what to change when it is a bad one. */
export interface Finding {
  question: string;
  verdict: string;
  /** The answer to the question, in a word or two. */
  answer: string;
  isGood: boolean;
  /** Found in the mean, and what it is held against, m. */
  found_m: number;
  bound_m: number;
  bound: string;
  /** What the figure means for the survey. */
  meaning: string;
  advice: string;
}

/** A robot that strays by more than this part of the domain's narrower side measures elsewhere. */
const STRAY_SHARE = 0.2;
/** A few flights scatter by this much about a prediction that is right. */
const SCATTER = 1.25;

/**
 * Whether the robot measures where the draft says: on its expected track, or where there is none
 * on its legs.
 */
export function straying(rehearsal: Rehearsal, domain: Box): Finding | null {
  const isExpected = typeof rehearsal.spread_m === 'number';
  const found_m = isExpected ? rehearsal.spread_m : rehearsal.rms_error_m;
  if (typeof found_m !== 'number') return null;
  const track = isExpected ? 'its expected track' : 'the plan';
  const narrow = Math.min(domain.x_max_m - domain.x_min_m, domain.y_max_m - domain.y_min_m);
  const bound_m = STRAY_SHARE * narrow;
  const isGood = found_m <= bound_m;
  return {
    question: isExpected ? 'Does it fly as expected?' : 'Does it fly the plan?',
    verdict: `${compact(found_m, 2)} m beside ${track}, rms`,
    answer: isGood ? 'Yes' : 'Not well',
    isGood,
    found_m,
    bound_m,
    bound: `${compact(bound_m, 2)} m, a fifth of the domain’s narrower side`,
    meaning: isGood
      ? `It measures about where ${isExpected ? 'that leads' : 'it was planned to'}.`
      : 'It measures elsewhere: the map stays right, but gains less than predicted.',
    advice: isGood
      ? ''
      : 'Raise the smallest depth change, so that glides settle; shorten the longest swim; or plan fewer primitives per edge, so that it surfaces sooner.',
  };
}

/** What a rehearsal says of a plan, in one sentence; "" while it has said nothing. */
export function rehearsalSentence(rehearsal: Rehearsal | null | undefined, domain: Box): Verdict {
  if (!rehearsal || rehearsal.state === 'working') return { text: '', isGood: true };
  if (rehearsal.state !== 'done')
    return { text: `${rehearsalWord(rehearsal).text}.`, isGood: false };
  if (rehearsal.completed === false) {
    return { text: 'Its rehearsal was cut short before the end.', isGood: false };
  }
  const bad = [straying(rehearsal, domain), knowing(rehearsal)].filter(
    (each) => each !== null && !each.isGood,
  );
  const risks = badChances(rehearsal.band);
  if (bad.length + risks.length === 0) return { text: 'Rehearsed well.', isGood: true };
  const asked = bad.map((each) => `${each?.question} ${each?.answer}: ${each?.verdict}.`);
  const told = [
    ...(asked.length > 0 ? ['Its rehearsal asks:', ...asked] : []),
    ...(risks.length > 0 ? [`Of the flights of its rehearsal ${risks.join(', ')}.`] : []),
  ];
  return { text: told.join(' '), isGood: false };
}

export interface Verdict {
  text: string;
  isGood: boolean;
}

/** Whether the predicted uncertainty covers how far the robot is from where it believes to be. */
export function knowing({ position_error_m, predicted_error_m }: Rehearsal): Finding | null {
  if (typeof position_error_m !== 'number' || typeof predicted_error_m !== 'number') return null;
  const isCovered = position_error_m <= predicted_error_m;
  const isGood = position_error_m <= predicted_error_m * SCATTER;
  return {
    question: 'Does it know where it is?',
    verdict: `${compact(position_error_m, 2)} m from where it believes to be, rms`,
    answer: !isGood ? 'Not well' : isCovered ? 'Yes' : 'Within chance',
    isGood,
    found_m: position_error_m,
    bound_m: predicted_error_m,
    bound: `${compact(predicted_error_m, 2)} m predicted`,
    meaning: isCovered
      ? 'As sure as predicted: its samples get the fidelity that the plan counts on.'
      : isGood
        ? 'Above the prediction, but by less than a quarter of it, as a few flights may be by chance.'
        : 'Less sure than predicted: the map would trust its samples too much.',
    advice: isGood
      ? ''
      : 'Raise the drift of the position filter until the prediction covers the error, or lower the maximum position uncertainty, so that it surfaces sooner.',
  };
}
