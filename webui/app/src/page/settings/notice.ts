import type { components } from '../../api/generated/station';
import type { PersonNotices } from '../../api/notice';

type Schemas = components['schemas'];
export type Wishes = PersonNotices['wishes'];
export type Hours = Wishes['duty'][number];
export type Least = Wishes['quiet_breaks'];
export type ContactForm = Schemas['ContactBody']['form'];
export type NoticeState = Schemas['NoticeView']['state'];

/** What is typed for each kind of contact. */
export const CONTACT_FORMS: readonly {
  key: ContactForm;
  title: string;
  label: string;
  example: string;
}[] = [
  { key: 'mail', title: 'Mail', label: 'Mail address', example: 'ann@example.org' },
  { key: 'ntfy', title: 'ntfy', label: 'Server and topic', example: 'https://ntfy.sh/a-long-word' },
  { key: 'webhook', title: 'Webhook', label: 'URL', example: 'https://example.org/hook' },
  { key: 'apprise', title: 'Other (apprise)', label: 'URL of apprise', example: 'slack://…' },
];

export const ALARM_TOPICS: readonly { key: keyof Wishes['alarms']; title: string }[] = [
  { key: 'alarm', title: 'What robots measure and do' },
  { key: 'contact', title: 'Robots that do not answer' },
  { key: 'battery', title: 'Low batteries' },
  { key: 'station', title: 'The station itself' },
];

export const LEAST_LEVELS = ['info', 'watch', 'warning', 'severe', 'critical', 'none'] as const;

/** A level as the least that somebody is told of. */
export function leastWords(level: string): string {
  if (level === 'none') return 'Never';
  const word = level.charAt(0).toUpperCase() + level.slice(1);
  return level === 'critical' ? word : `${word} and graver`;
}

export const STATES: Readonly<Record<NoticeState, string>> = {
  queued: 'Waits',
  handed: 'A service took it',
  given_up: 'Given up',
  withdrawn: 'Seen before it was sent',
};

/** What is proved of a notice; one that was tried in vain, or may have come twice, says so. */
export function stateWords(state: NoticeState, attempts: number, unanswered: number): string {
  const words =
    state === 'queued' && attempts > 0 ? `Tried ${attempts} ×, is tried again` : STATES[state];
  if (unanswered === 0) return words;
  return `${words}; ${state === 'handed' ? 'it may have come twice' : 'it may have come all the same'}`;
}

/** A new night, as most people sleep. */
export const NIGHT: Hours = { days: [0, 1, 2, 3, 4, 5, 6], begin: '22:00', end: '07:00' };
/** A new time on duty. */
export const WORKING_DAY: Hours = { days: [0, 1, 2, 3, 4], begin: '08:00', end: '16:00' };
export const DAYS = ['Mon', 'Tue', 'Wed', 'Thu', 'Fri', 'Sat', 'Sun'] as const;

export function withDay(hours: Hours, day: number, isIn: boolean): Hours {
  const days = hours.days.filter((one) => one !== day);
  return { ...hours, days: isIn ? [...days, day].toSorted((a, b) => a - b) : days };
}
