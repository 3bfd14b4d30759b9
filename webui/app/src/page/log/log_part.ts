import type { LogGroup } from '../../api/log_book';
import type { LogItem } from '../../api/types';

export const GROUP_TITLES: Readonly<Record<LogGroup, { title: string; help: string }>> = {
  entries: { title: 'Entries', help: 'What people write.' },
  orders: { title: 'Orders', help: 'Commands, and what became of them.' },
  dives: { title: 'Dives', help: 'Dives, surfacings, deployments.' },
  alarms: { title: 'Alarms', help: 'Raised, acknowledged, back to normal.' },
  plans: { title: 'Plans', help: 'Sent, on board, running, done.' },
  watch: { title: 'Watch', help: 'Shifts and signed pages.' },
};
export const ALL_GROUPS = Object.keys(GROUP_TITLES) as LogGroup[];

/** Lines of both, the last moments first, each once; the newer reading of a line counts. */
export function joined(newest: readonly LogItem[], earlier: readonly LogItem[]): LogItem[] {
  const known = new Set(newest.map(({ place }) => place));
  return [...newest, ...earlier.filter(({ place }) => !known.has(place))];
}

/** Lines with what happened between two entries as one, but for what is grave. */
export function folded(items: readonly LogItem[]): LogItem[][] {
  const lines: LogItem[][] = [];
  for (const item of items) {
    const above = lines.at(-1);
    const last = above?.at(-1);
    if (above && last && isQuiet(item) && isQuiet(last)) above.push(item);
    else lines.push([item]);
  }
  return lines;
}

function isQuiet({ event }: LogItem): boolean {
  return event !== null && event.level !== 'critical';
}
