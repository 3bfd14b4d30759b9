import type { RobotState, TargetPhase, TargetReport } from '../../api/types';
import { ellipse95 } from '../../chart/ellipse';
import { duration } from '../../text/time';
import type { Tone } from '../../text/word';
import { knowable, type Lately } from './observability';

interface PhaseWord {
  /** The state in a few words, for a person who walks up. */
  text: string;
  tone: Tone;
  help: string;
}

const PHASES: Record<TargetPhase, PhaseWord> = {
  waiting: {
    text: 'Waiting for its first range',
    tone: 'watch',
    help: 'No range was heard yet. The robot knows nothing of the target but the first guess.',
  },
  tracking: {
    text: 'Has its target',
    tone: 'ok',
    help: 'Ranges come in, and the estimate agrees with them.',
  },
  coasting: {
    text: 'Hears no range',
    tone: 'watch',
    help: 'The estimate goes on by dead reckoning and its ellipse grows.',
  },
  lost: {
    text: 'Lost its target',
    tone: 'alarm',
    help: 'Ranges failed for too long, or contradict the estimate. The robot circles to find it.',
  },
  ended: { text: 'No longer follows', tone: 'plain', help: 'The mission is over.' },
};

const ASTRAY: PhaseWord = {
  text: 'Believes it has its target',
  tone: 'watch',
  help: 'Ranges agree with the estimate, but the truth, which is known, lies outside its ellipse.',
};

const TOO_FAST: PhaseWord = {
  text: 'Target too fast to follow',
  tone: 'watch',
  help: 'The target swims faster than the robot may. It is still held, and will be lost.',
};

const VAGUE: PhaseWord = {
  text: 'Hears its target, unsure where it is',
  tone: 'watch',
  help: 'Ranges come in, but the target may be on any side: its ellipse is larger than its distance.',
};

/**
 * What a phase is called.
 *
 * @param astray Where the estimate is known to be wrong.
 * @param tooFast Where the target is too fast to follow.
 * @param vague Where the estimate says too little of the place.
 */
export function phaseWord(
  phase: TargetPhase,
  astray = false,
  tooFast = false,
  vague = false,
): PhaseWord {
  if (phase !== 'tracking') return PHASES[phase];
  if (tooFast) return TOO_FAST;
  if (astray) return ASTRAY;
  return vague ? VAGUE : PHASES.tracking;
}

/** Whether the target may be on any side of the robot: its ellipse is larger than its distance. */
export function isVague({
  hypotheses: [likeliest],
  position_ne_m: [north, east],
}: Pick<TargetReport, 'hypotheses' | 'position_ne_m'>): boolean {
  const ellipse = likeliest ? ellipse95(likeliest.covariance_m2) : null;
  if (!likeliest || ellipse === null) return false;
  const [atNorth, atEast] = likeliest.position_ne_m;
  return ellipse.longM > Math.hypot(atNorth - north, atEast - east);
}

/** A truth that lies just outside is chance: one in twenty does. */
const CLEARLY = 1.5;

/** Whether the estimate is known to be wrong: the truth lies well outside the likeliest ellipse. */
export function isAstray({ error_m, hypotheses: [likeliest] }: TargetReport): boolean {
  const ellipse = likeliest ? ellipse95(likeliest.covariance_m2) : null;
  return error_m !== null && ellipse !== null && error_m > CLEARLY * ellipse.longM;
}

/** Times after which silence counts, s, as the plan set them. */
export interface Patience {
  lostAfterS: number;
  giveUpAfterS: number;
}

/** What a person can do about it now, a sentence; empty where there is nothing to say. */
export function advice(
  track: TargetReport,
  patience: Patience | null,
  level: number | null = null,
  past?: Lately,
): string {
  const loses = patience && `Counts as lost after ${duration(patience.lostAfterS)} of silence.`;
  const gives = patience && `Gives up ${duration(patience.giveUpAfterS)} after it lost it.`;
  switch (track.phase) {
    case 'waiting':
      return track.is_quiet
        ? 'It was told not to ping: press “Ping again”.'
        : 'If none comes, check that the target’s modem answers at its address.';
    case 'coasting':
      return said(track.is_quiet ? 'It was told not to ping: press “Ping again”.' : loses);
    case 'lost':
      if (!track.is_barrier_on && !track.is_quiet) {
        return 'Teaching: it goes on and does not search. Surface it when you have seen enough.';
      }
      return said(
        track.is_quiet
          ? 'It was told not to ping: press “Ping again”.'
          : 'It circles and listens. If it goes on, surface it and look after the target.',
        gives,
      );
    case 'tracking':
      if (!track.is_barrier_on)
        return 'Teaching: nothing keeps its estimate right, and it may go wrong at any time.';
      if (isAstray(track))
        return 'Its estimate is wrong. It searches once the ranges contradict it; else plan anew.';
      if (!track.is_feasible)
        return 'Nothing to do: it turns as hard as it can to know its target better.';
      return knowable(track, level, past).tone === 'watch'
        ? 'Nothing to do: it bends its course to know its target better.'
        : 'Nothing to do.';
    case 'ended':
      return 'Make a new plan to follow a target again.';
  }
}

function said(...sentences: (string | null)[]): string {
  return sentences.filter(Boolean).join(' ');
}

/** Since when the robot is in its present phase, and whether it may have been for longer. */
export function phaseSince(
  reports: readonly Pick<TargetReport, 'phase' | 'measured_at'>[],
): { at: string; isAtLeast: boolean } | null {
  const phase = reports.at(-1)?.phase;
  if (phase === undefined) return null;
  const before = reports.findLastIndex((report) => report.phase !== phase);
  const first = reports[before + 1];
  return first ? { at: first.measured_at, isAtLeast: before < 0 } : null;
}

/** Whether something of it is worth a line on other pages. */
export function isFollowing(state: Pick<RobotState, 'tracking'> | null | undefined): boolean {
  return Boolean(state?.tracking && state.tracking.phase !== 'ended');
}
