import type { Command, CommandLevelName } from '../api/types';
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

const ENDS: Partial<Record<CommandLevelName, { title: string; help: string }>> = {
  refused: { title: 'Refused', help: 'The robot said that it does not carry the order out.' },
  expired: {
    title: 'Expired',
    help: 'The time of the order ran out. It will not be sent late.',
  },
};

/** The steps of an order, each shown only once it is proved. */
export function orderSteps(order: Order): Step[] {
  const steps = order.command === null ? LEVELS.map(openStep) : commandSteps(order.command);
  const open = steps.find(({ at }) => at === null);
  if (open && order.refusal === null) open.isPending = true;
  return steps;
}

/** The same of a command that nobody waits for. */
export function commandSteps(command: Command): Step[] {
  const steps = LEVELS.map((rung) => {
    const proof = command.levels.find(({ level }) => level === rung.level);
    const detail = proof?.carrier ? `by ${carrierName(proof.carrier)}` : '';
    return { ...openStep(rung), at: proof?.at ?? null, detail };
  });
  const end = command.levels.find(({ level }) => level === 'refused' || level === 'expired');
  if (!end) return steps;
  const proved = steps.filter(({ at }) => at !== null);
  return [
    ...proved,
    {
      ...(ENDS[end.level] ?? { title: end.level, help: '' }),
      at: end.at,
      detail: end.reason,
      isFault: true,
    },
  ];
}

function openStep({ title, help }: { title: string; help: string }): Step {
  return { title, help, at: null };
}

const NAMES: Record<string, string> = {
  surface: 'Surface',
  hold: 'Hold',
  resume: 'Resume',
  start: 'Start',
  quiet: 'Stop pinging:',
  ping: 'Ping again:',
};

/** Kind and addressee of an order, such as "Surface mini-1". */
export function commandName({ kind, robot }: { kind: string; robot: string }): string {
  return `${NAMES[kind] ?? kind} ${robot}`;
}
