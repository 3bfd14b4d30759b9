import type { TrackView } from '../../api/types';
import type { Tone } from '../../text/word';

interface Level {
  /** How well the target can be known, one or two words. */
  text: string;
  tone: Tone;
  meaning: string;
}

/** From the least inverse condition on; on the steady orbit it is the most turn rate in rad/s. */
const LEVELS: readonly (Level & { from: number })[] = [
  {
    from: 0.3,
    text: 'well',
    tone: 'ok',
    meaning: 'The course bends enough: each range tells of a new direction.',
  },
  {
    from: 0.1,
    text: 'fairly',
    tone: 'plain',
    meaning: 'The course bends a little: side and distance are told apart, slowly.',
  },
  {
    from: 0.02,
    text: 'poorly',
    tone: 'watch',
    meaning: 'The course is nearly straight to the target: left and right look almost alike.',
  },
  {
    from: 0,
    text: 'not at all',
    tone: 'alarm',
    meaning: 'From this course a range alone cannot tell left from right.',
  },
];

const UNKNOWN: Level = { text: 'not known', tone: 'plain', meaning: 'No range was heard yet.' };

/** What an inverse condition number means, in words. */
export function observability(inverseCondition: number | null): Level {
  if (inverseCondition === null || !Number.isFinite(inverseCondition)) return UNKNOWN;
  return LEVELS.find(({ from }) => inverseCondition >= from) ?? UNKNOWN;
}

/** Why the robot circles; in the words that a newcomer reads first. */
export const WHY_IT_CIRCLES =
  'It circles because from a straight course a range alone cannot tell left from right.';

/** What the barrier does now, a sentence. */
export function barrierSentence(
  track: Pick<TrackView, 'is_barrier_on' | 'is_feasible' | 'command' | 'nominal'>,
): { text: string; tone: Tone } {
  if (!track.is_barrier_on) {
    return { text: 'Off: nothing keeps the target observable (teaching).', tone: 'watch' };
  }
  if (!track.is_feasible) {
    return {
      text: 'It cannot be kept at this moment; the robot does what raises it most.',
      tone: 'watch',
    };
  }
  return changes(track)
    ? { text: 'It bends the course so that the target stays observable.', tone: 'ok' }
    : { text: 'The course is good as it is; the barrier changes nothing.', tone: 'ok' };
}

/** Share of the wanted motion beyond which a change counts. */
const LEAST_CHANGE = 1e-3;

function changes({ command, nominal }: Pick<TrackView, 'command' | 'nominal'>): boolean {
  return command.some((done, i) => Math.abs(done - (nominal[i] ?? 0)) > LEAST_CHANGE);
}
