import type { AlarmLevel, Robot, LiveRobot } from '../../api/types';
import { isGrave, linkWord, rank } from '../../text/word';

/** Reasons for which a robot needs a person, the most urgent first. */
export const NEEDS = [
  'severe or critical alarm',
  'out of contact',
  'contact overdue',
  'alarm',
  'battery low',
  'surfaces soon',
  'nothing',
] as const;

export type Need = (typeof NEEDS)[number];

/** Of a full charge; less is told as low, whatever rules of alarm a team has. */
export const LOW_BATTERY = 0.25;
/** Time of the robots' clock before a predicted contact, s: somebody may want to be ready. */
export const SOON_S = 300;

/** What the page knows of a robot that decides how much it needs somebody. */
export interface Known {
  level: AlarmLevel;
  link: { state: string; carrier: string };
  /** Predicted, ms since 1970; `null` where nobody knows. */
  contactAt: number | null;
  /** 0 .. 1; `null` where the robot does not tell. */
  battery: number | null;
}

/** Why a robot needs somebody most, at a moment of station time, ms since 1970. */
export function needOf(known: Known, now: number): Need {
  if (isGrave(known.level)) return 'severe or critical alarm';
  if (linkWord(known.link.state, known.link.carrier).tone === 'alarm') return 'out of contact';
  const leftS = known.contactAt === null ? null : (known.contactAt - now) / 1000;
  if (leftS !== null && leftS < 0) return 'contact overdue';
  if (rank(known.level) >= rank('watch')) return 'alarm';
  if (known.battery !== null && known.battery < LOW_BATTERY) return 'battery low';
  if (leftS !== null && leftS < SOON_S) return 'surfaces soon';
  return 'nothing';
}

export function knownOf(robot: Robot, report: LiveRobot | null): Known {
  const contact = (report?.next_contact ?? robot.next_contact)?.at;
  return {
    level: report?.alarm_level ?? robot.alarm_level ?? 'normal',
    link: report?.link ?? robot.link,
    contactAt: contact ? Date.parse(contact) : null,
    battery: report?.channels.battery_fraction?.value ?? null,
  };
}

/** More robots than these are searched, ordered and folded; fewer are seen at a glance. */
export const MANY = 8;

export type Order = 'need' | 'name';

export interface Entry {
  robot: Robot;
  need: Need;
}

/**
 * Robots in the order in which a person wants to see them.
 *
 * Those of one need stand by name, so that none moves while its need stays the same.
 */
export function ordered(entries: readonly Entry[], order: Order): Entry[] {
  const byName = (a: Entry, b: Entry) =>
    a.robot.name.localeCompare(b.robot.name, 'en', { numeric: true });
  if (order === 'name') return entries.toSorted(byName);
  return entries.toSorted((a, b) => NEEDS.indexOf(a.need) - NEEDS.indexOf(b.need) || byName(a, b));
}

/** Whether every word that was typed stands in what a card says of a robot. */
export function isFound(robot: Robot, typed: string): boolean {
  const told = [robot.name, robot.id, robot.model, robot.site.name, robot.kind]
    .join(' ')
    .toLowerCase();
  return typed
    .toLowerCase()
    .split(/\s+/)
    .every((word) => told.includes(word));
}
