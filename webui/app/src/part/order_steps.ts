import type { Command, CommandLevelName, RobotLink } from '../api/types';
import type { Order } from '../live/order.svelte';
import type { RobotLive } from '../live/station.svelte';
import { carrierName, isSatellite, readable } from '../text/word';
import { shownState } from './link_state';
import type { Step } from './step';

const LEVELS: readonly { level: CommandLevelName; title: string; help: string }[] = [
  {
    level: 'queued',
    title: 'Queued',
    help: 'The radio of the station, or the gateway, took the order. The robot may not have it.',
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

const OVERTAKEN = { title: 'Overtaken', help: 'A later order took its place.', isFault: false };

/** Whether an order ended before its time since the robot was told something else. */
function isOvertaken({ level, reason }: Command['levels'][number]): boolean {
  return level === 'expired' && /a later order took its place|is told to surface/.test(reason);
}

/** The steps of an order, each shown only once it is proved. */
export function orderSteps(order: Order, links: readonly RobotLink[] = []): Step[] {
  const { command } = order;
  const steps = command === null ? LEVELS.map(openStep) : commandSteps(command, links);
  const open = steps.find(({ at }) => at === null);
  if (open && order.refusal === null) open.isPending = true;
  return steps;
}

/** The same of a command that nobody waits for; `links` are the robot's as they are now. */
export function commandSteps(command: Command, links: readonly RobotLink[] = []): Step[] {
  const steps = LEVELS.map((rung) => {
    const proofs = command.levels.filter(({ level }) => level === rung.level);
    return { ...openStep(rung), at: proofs[0]?.at ?? null, detail: carriedBy(proofs, links) };
  });
  const end = command.levels.find(({ level }) => level === 'refused' || level === 'expired');
  if (!end) return steps;
  const proved = steps.filter(({ at }) => at !== null);
  return [
    ...proved,
    {
      isFault: true,
      ...(isOvertaken(end) ? OVERTAKEN : (ENDS[end.level] ?? { title: end.level, help: '' })),
      at: end.at,
      detail: end.reason,
    },
  ];
}

/** A radio takes an order also while it does not reach the robot, which is then not on its way. */
function carriedBy(proofs: Command['levels'], links: readonly RobotLink[]): string {
  const carriers = [...new Set(proofs.map(({ carrier }) => carrier).filter(Boolean))];
  const [first] = carriers;
  if (first === undefined) return '';
  const gateways = carriers.filter(isSatellite);
  if (gateways.length > 0) return `by ${gateways.map(carrierName).join(' and ')}`;
  const radios = links.filter(({ carrier }) => carriers.includes(carrier));
  const isOut = radios.length > 0 && radios.every((link) => shownState(link) !== 'live');
  if (isOut && proofs[0]?.level === 'queued') return `${carrierName(first)} does not reach it now`;
  return `by ${carriers.map(carrierName).join(' and ')}`;
}

/** What a robot does that is at the surface and stays there. */
const UP: readonly string[] = ['idle', 'surfaced', 'holding'];

/** Whether the robot, heard after it had obeyed an order to surface, was up. */
export function isUp(command: Command, report: RobotLive['report'] | undefined): boolean {
  const answer = command.levels.find(({ level }) => level === 'applied');
  if (command.kind !== 'surface' || !answer || !report) return false;
  const isNewer = report.links.some(
    ({ heard_at }) => heard_at !== null && Date.parse(heard_at) >= Date.parse(answer.at),
  );
  return isNewer && UP.includes(report.mode ?? '');
}

/** How far an order is proved; a robot that has come up is not told to be coming up. */
export function orderText(command: Command, report: RobotLive['report'] | undefined): string {
  return isUp(command, report) ? `${command.robot} is up, as ordered.` : readable(command.text);
}

/** Whether nothing more is expected of an order, and nobody has to read why. */
export function isFinished(command: Command, report: RobotLive['report'] | undefined): boolean {
  if (command.level === 'applied') return command.kind !== 'surface' || isUp(command, report);
  return command.level === 'expired';
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
  arm: 'Arm',
  disarm: 'Disarm',
  zero_depth: 'Zero the depth of',
};

/** Kind and addressee of an order, such as "Surface mini-1". */
export function commandName({ kind, robot }: { kind: string; robot: string }): string {
  return `${NAMES[kind] ?? kind} ${robot}`;
}
