import type { PartLevel, Time, Transfer, TransferPart } from '../api/types';
import { carrierName } from '../text/word';
import type { Step } from './step';

const RUNGS = [
  {
    level: 'queued',
    title: 'Queued',
    help: 'The gateway took every message. The robot may have none of them.',
  },
  {
    level: 'radio',
    title: 'Radio',
    help: 'The robot’s modem fetched every message. The robot has not said what it made of them.',
  },
] as const;

const APPLIED = {
  title: 'Applied',
  help: 'The robot put the plan together and answered with the plan’s own fingerprint (SHA-256).',
};

const ENDS: Record<string, { title: string; help: string; isFault: boolean }> = {
  refused: {
    title: 'Refused',
    help: 'The robot, or the gateway, said that it does not take the plan.',
    isFault: true,
  },
  failed: {
    title: 'Not confirmed',
    help: 'It was given up, or its time ran out, before the robot confirmed the plan. It keeps what it had.',
    isFault: true,
  },
  withdrawn: {
    title: 'Withdrawn',
    help: 'A person called it off; nothing more of it is sent.',
    isFault: false,
  },
  superseded: { title: 'Replaced', help: 'A newer plan took its place.', isFault: false },
}; // prettier-ignore

const ORDER: readonly PartLevel[] = ['waiting', 'queued', 'radio'];

export function hasReached(part: Pick<TransferPart, 'level'>, level: PartLevel): boolean {
  return ORDER.indexOf(part.level) >= ORDER.indexOf(level);
}

/** How a transfer ended: `applied`, one of the ends, or `null` while it is under way. */
export function transferEnd(transfer: Transfer): string | null {
  const said = [transfer.state, transfer.level].map((word) => word.toLowerCase());
  const ends = ['applied', 'refused', 'withdrawn', 'superseded', 'failed'];
  const found = ends.find((end) => said.includes(end));
  if (found !== undefined) return found;
  if (said.includes('on_board') || said.includes('running')) return 'applied';
  if (said.includes('kept')) return 'applied';
  return transfer.ended_at === null ? null : 'failed';
}

/** Whether there is something of it to tell that the plan's own ladder does not tell. */
export function isTelling(transfer: Transfer, planState: string): boolean {
  if (transferEnd(transfer) !== 'applied') return true;
  return (
    transfer.parts.length > 0 && ['sent', 'waiting', 'on_board', 'running'].includes(planState)
  );
}

/**
 * Queued, radio, applied: each with the moment at which all of it was proved.
 *
 * A transfer that also starts the plan goes on after the robot has it; `onBoardAt` tells since when.
 */
export function transferSteps(transfer: Transfer, onBoardAt: Time | null = null): Step[] {
  const parts = transfer.parts;
  const end = transferEnd(transfer);
  const isApplied = end === 'applied';
  const appliedAt = isApplied ? (onBoardAt ?? transfer.ended_at ?? '') : null;
  const steps: Step[] = RUNGS.map(({ level, title, help }) => {
    const proved = parts.filter((part) => hasReached(part, level)).length;
    const isWhole = parts.length > 0 && proved === parts.length;
    const at = isWhole ? newest(parts, level) : appliedAt;
    const some = at === null && proved > 0 ? `${proved} of ${parts.length}` : '';
    return { title, help, at, detail: some };
  });
  steps.push({ ...APPLIED, at: appliedAt });
  if (isApplied) return steps;
  const word = end === null ? undefined : ENDS[end];
  if (word) {
    return [...steps.filter(({ at }) => at !== null), { ...word, at: transfer.ended_at }];
  }
  const open = steps.find(({ at }) => at === null);
  if (open) open.isPending = true;
  return steps;
}

/** Moment at which the last of the parts reached a level. */
function newest(parts: readonly TransferPart[], level: 'queued' | 'radio'): Time | null {
  const field = level === 'queued' ? 'queued_at' : 'radio_at';
  const times = parts.map((part) => part[field] ?? part.radio_at ?? '').sort();
  return times.at(-1) || null;
}

/** What is known of a transfer and no more, where the station says nothing itself. */
export function transferSentence(transfer: Transfer): string {
  if (transfer.text) return transfer.text;
  if (transfer.reason) return transfer.reason;
  if (transfer.ended_at !== null || transfer.items === 0) return '';
  const by = transfer.carrier ? ` by ${carrierName(transfer.carrier)}` : '';
  return `Sending${by}: ${transfer.items_sent} of ${transfer.items} items.`;
}

export function partWord(level: PartLevel): string {
  return { waiting: 'Waiting', queued: 'Queued', radio: 'Radio' }[level];
}
