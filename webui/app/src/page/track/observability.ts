import type { TargetReport } from '../../api/types';
import { ellipse95 } from '../../chart/ellipse';
import { compact } from '../../text/unit';
import type { Tone } from '../../text/word';
import type { Keeper } from './config';

interface Level {
  /** How well the target can be known, one or two words. */
  text: string;
  tone: Tone;
}

/**
 * From the least inverse condition on; on the steady orbit it is the most turn rate in rad/s.
 *
 * Each speaks of the moment alone: the tail swings the number within a few seconds, near and far.
 */
const MEANINGS: readonly (Level & { from: number; meaning: string })[] = [
  {
    from: 0.3,
    text: 'well',
    tone: 'ok',
    meaning: 'At this moment left and right are told apart well.',
  },
  {
    from: 0.1,
    text: 'fairly',
    tone: 'plain',
    meaning: 'At this moment left and right are told apart, slowly.',
  },
  {
    from: 0.02,
    text: 'poorly',
    tone: 'watch',
    meaning: 'At this moment left and right are hard to tell apart; the robot must keep turning.',
  },
  {
    from: 0,
    text: 'hardly',
    tone: 'watch',
    meaning: 'At this moment a range hardly tells left from right; the robot must keep turning.',
  },
];

/** Nothing is known but the moment itself. */
const MOMENT: Lately = { determinant: null, grows: false };

const NOT_NOW: Level = { text: 'not now', tone: 'watch' };

const UNKNOWN = { text: 'not known', tone: 'plain', meaning: 'No range was heard yet.' } as const;

/** What an inverse condition number means, in words. */
export function observability(inverseCondition: number | null): Level & { meaning: string } {
  if (inverseCondition === null || !Number.isFinite(inverseCondition)) return UNKNOWN;
  return MEANINGS.find(({ from }) => inverseCondition >= from) ?? UNKNOWN;
}

/** On its orbit the robot is at the level itself; noise takes it a little below. */
const AT_LEVEL = 0.9;

/** What is compared with what the robot said of late, s of robot time. */
const TREND_S = 180;
const LATELY_S = 60;
const FEWEST = 4;
/** On a steady orbit the ellipse breathes by less. */
const GROWTH = 1.3;

/** How it went for the last minute: the tail swings the determinant of a moment up and down. */
export interface Lately {
  /** Mean size of the determinant, m²/s; `null` where there was none. */
  determinant: number | null;
  /** Whether the robot's own ellipse has grown: its ranges tell too little. */
  grows: boolean;
}

/** How it went for the last minute by what a robot said. */
export function lately(
  reports: readonly Pick<TargetReport, 'measured_at' | 'hypotheses' | 'determinant_m2_s'>[],
): Lately {
  const newest = Date.parse(reports.at(-1)?.measured_at ?? '');
  const [sizes, earlier, determinants]: [number[], number[], number[]] = [[], [], []];
  for (const { measured_at, hypotheses, determinant_m2_s } of reports.toReversed()) {
    const ageS = (newest - Date.parse(measured_at)) / 1000;
    if (ageS > TREND_S) break;
    const size = hypotheses[0] && ellipse95(hypotheses[0].covariance_m2)?.longM;
    if (size === undefined) continue;
    (ageS <= LATELY_S ? sizes : earlier).push(size);
    if (ageS <= LATELY_S) determinants.push(Math.abs(determinant_m2_s));
  }
  const isTelling = sizes.length >= FEWEST && earlier.length >= FEWEST;
  return {
    determinant: determinants.length > 0 ? mean(determinants) : null,
    grows: isTelling && middle(sizes) > GROWTH * middle(earlier),
  };
}

function mean(values: readonly number[]): number {
  return values.reduce((sum, value) => sum + value, 0) / values.length;
}

function middle(values: readonly number[]): number {
  return values.toSorted((a, b) => a - b)[Math.floor(values.length / 2)] ?? NaN;
}

type Seen = Pick<TargetReport, 'hypotheses' | 'determinant_m2_s' | 'inverse_condition' | 'phase'>;

/**
 * How well a target can be known by what the barrier asks for.
 *
 * The inverse condition number is small from afar however well the robot does; the determinant
 * against its level says whether it does what it can. Below it is too little only once the ellipse
 * grows. Without ranges that are believed nothing can be known, wherever the robot swims.
 */
export function knowable(track: Seen, level: number | null, past: Lately = MOMENT): Level {
  if (track.hypotheses.length === 0 || track.phase === 'ended') return UNKNOWN;
  if (track.phase === 'coasting' || track.phase === 'lost') return NOT_NOW;
  const seen = observability(track.inverse_condition);
  if (level === null) return seen;
  const share = determinantOf(track, past) / level;
  // From afar the level is easily kept while left and right look alike all the same.
  if (share >= AT_LEVEL && seen.text === 'hardly') return { text: 'slowly', tone: 'plain' };
  if (share >= AT_LEVEL) return { text: seen.text === 'well' ? 'well' : 'enough', tone: 'ok' };
  if (past.grows) return { text: 'too little', tone: 'watch' };
  return { text: 'just enough', tone: 'plain' };
}

/** The figure behind the word: what the barrier measures, or without one the inverse condition. */
export function knowableFigure(track: Seen, level: number | null, past: Lately = MOMENT): string {
  if (track.hypotheses.length === 0 || track.phase === 'ended') return '';
  if (track.phase === 'coasting' || track.phase === 'lost') return 'no range is believed';
  if (level === null) return `inverse condition ${compact(track.inverse_condition, 2)}`;
  const share = Math.round((100 * determinantOf(track, past)) / level);
  return past.determinant === null
    ? `|D| ${share} % of its level`
    : `last minute: |D| ${share} % of its level`;
}

function determinantOf(track: Seen, past: Lately): number {
  return past.determinant ?? Math.abs(track.determinant_m2_s);
}

/** Why the robot circles; in the words that a newcomer reads first. */
export const WHY_IT_CIRCLES =
  'It circles because from a straight course a range alone cannot tell left from right.';

/** What the barrier does now, a sentence. */
export function barrierSentence(
  track: Pick<TargetReport, 'phase' | 'is_barrier_on' | 'is_feasible' | 'command' | 'nominal'>,
  keeper: Keeper = 'barrier',
): { text: string; tone: Tone } {
  if (keeper === 'comparison') {
    return { text: 'Off for comparison: nothing keeps the target observable.', tone: 'watch' };
  }
  if (keeper === 'predictive') {
    return { text: 'A predictive controller takes its place.', tone: 'plain' };
  }
  if (!track.is_barrier_on) {
    return { text: 'Off: nothing keeps the target observable (teaching).', tone: 'watch' };
  }
  if (track.phase === 'lost') {
    return { text: 'It waits while the robot circles to find its target.', tone: 'plain' };
  }
  if (!track.is_feasible) {
    return {
      text: 'It cannot be kept at this moment; the robot does what raises it most.',
      tone: 'plain',
    };
  }
  return changes(track)
    ? { text: 'It bends the course so that the target stays observable.', tone: 'ok' }
    : { text: 'The course is good as it is; the barrier changes nothing.', tone: 'ok' };
}

/** Share of the wanted motion beyond which a change counts. */
const LEAST_CHANGE = 1e-3;

function changes({ command, nominal }: Pick<TargetReport, 'command' | 'nominal'>): boolean {
  return command.some((done, i) => Math.abs(done - (nominal[i] ?? 0)) > LEAST_CHANGE);
}
