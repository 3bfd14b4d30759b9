import type { CommandLevelName } from '../api/types';
import type { Order } from '../live/order.svelte';
import { carrierName } from '../text/word';
import type { Step } from './step';

const LEVELS: readonly { level: CommandLevelName; title: string; help: string }[] = [
  {
    level: 'queued',
    title: 'Queued',
    help: 'The radio of the station took the order. The robot may not have it.',
  },
  {
    level: 'radio',
    title: 'Delivered',
    help: 'The radio of the robot has the order. The robot has not answered yet.',
  },
  { level: 'applied', title: 'Done', help: 'The robot said that it carries the order out.' },
];

/** The steps of an order, each shown only once it is proved. */
export function orderSteps(order: Order): Step[] {
  const proofs = order.command?.levels ?? [];
  const end = proofs.find(({ level }) => level === 'refused' || level === 'expired');
  const steps: Step[] = LEVELS.map(({ level, title, help }) => {
    const proof = proofs.find((candidate) => candidate.level === level);
    const carrier = proof?.carrier ? `by ${carrierName(proof.carrier)}` : '';
    return { title, help, at: proof?.at ?? null, detail: carrier };
  });
  const open = steps.find(({ at }) => at === null);
  if (open && !end && order.refusal === null) open.isPending = true;
  if (!end) return steps;
  const title = end.level === 'refused' ? 'Refused' : 'Expired';
  const help =
    end.level === 'refused'
      ? 'The robot said that it does not carry the order out.'
      : 'The time of the order ran out. It will not be sent late.';
  const proved = steps.filter(({ at }) => at !== null);
  return [...proved, { title, help, at: end.at, detail: end.reason, isFault: true }];
}

const NAMES: Record<string, string> = { surface: 'Surface', hold: 'Hold', resume: 'Resume' };

export function orderName(order: Order): string {
  return `${NAMES[order.kind] ?? order.kind} ${order.robot}`;
}
