import type { Plan, PlanState } from '../api/types';
import { planWord } from '../text/word';
import type { Step } from './step';

const RUNGS = [
  ['draft', 'draft_at'],
  ['sent', 'sent_at'],
  ['waiting', 'waiting_at'],
  ['on_board', 'on_board_at'],
  ['running', 'running_at'],
] as const;

const ENDS: readonly PlanState[] = ['done', 'failed', 'superseded', 'cancelled'];

/**
 * Draft, sent, on board, running, ended: each with the moment at which it was proved. A plan that
 * waited on board behind another has that rung too.
 */
export function planSteps(plan: Pick<Plan, 'state' | 'ladder' | 'progress'>): Step[] {
  const rungs = RUNGS.filter(([state]) => state !== 'waiting' || plan.ladder.waiting_at);
  const steps: Step[] = rungs.map(([state, field]) => {
    const { text, help } = planWord(state);
    return { title: text, help, at: plan.ladder[field] ?? null };
  });
  if (ENDS.includes(plan.state)) {
    const { text, help, tone } = planWord(plan.state);
    const isFault = tone === 'alarm';
    const reached = plan.state === 'done' ? steps : steps.filter(({ at }) => at !== null);
    return [...reached, { title: text, help, at: plan.ladder.ended_at, isFault }];
  }
  const pending = plan.state === 'planning' ? 0 : plan.state === 'sent' ? rungs.length - 2 : null;
  const step = pending === null ? undefined : steps[pending];
  if (step?.at === null) step.isPending = true;
  return steps;
}

const SENTENCES: Record<PlanState, string> = {
  planning: 'The planner is searching. Nothing is sent.',
  draft: 'Only the station has this plan. Nothing is sent.',
  sent: 'On its way. The robot has not confirmed it and keeps what it had.',
  waiting: 'The robot keeps it on board behind the plan that it flies, until the next surfacing.',
  on_board: 'The robot has the plan: it answered with the plan’s fingerprint.',
  running: 'The robot says that it is flying this plan.',
  done: 'The robot says that it flew the last leg.',
  failed: 'The plan ended before its last leg.',
  superseded: 'A newer plan took its place.',
  cancelled: 'A person ended it.',
};

/** The same of a plan that follows a target and has no legs. */
const FOLLOWING: Partial<Record<PlanState, string>> = {
  running: 'The robot says that it follows this plan’s target.',
  done: 'The robot says that the time of this plan is over.',
  failed: 'The robot ended it before its time.',
};

/** The station's own words of it, which leave nothing to add. */
const ENDED_EARLY = /^\S+ ended \S+ early:/;

/** What is known of the plan's whereabouts, and no more. */
export function planSentence(
  plan: Pick<Plan, 'state' | 'message' | 'stage'> & { kind?: string },
): string {
  if (plan.state === 'planning' && plan.stage === 'rehearsing') {
    return 'Found; the simulator flies it before it is offered. Nothing is sent.';
  }
  if (plan.state === 'planning' && plan.stage === 'waiting') {
    return 'It waits until the other robots of the survey are planned for. Nothing is sent.';
  }
  // It left the station once: that nobody else has it cannot be said any more.
  if (plan.state === 'draft' && plan.message.startsWith('Not confirmed')) {
    return `${plan.message} What left the station may still reach the robot.`;
  }
  if (plan.state === 'failed' && ENDED_EARLY.test(plan.message)) return plan.message;
  const isTold = ['failed', 'cancelled'].includes(plan.state) && plan.message !== '';
  const told = isTold ? ` ${plan.message}` : '';
  const following = plan.kind === 'track_target' ? FOLLOWING[plan.state] : undefined;
  return (following ?? SENTENCES[plan.state]) + told;
}

/** Why a draft no longer fits its robot; empty while it does. */
export function staleSentence(plan: Pick<Plan, 'state' | 'outdated'> | null): string {
  if (plan?.state !== 'draft') return '';
  return plan.outdated.map(({ message }) => message).join(' ');
}
