import type { LinkKind, RobotLink } from '../api/types';
import { carrierName, isSatellite, words } from '../text/word';
import type { IconName } from './Icon.svelte';

export const LINK_ICONS: Record<LinkKind, IconName> = {
  radio: 'radio',
  satellite: 'satellite',
  acoustic: 'acoustic',
  camera: 'camera',
};

/** A state has a shape of its own, so that no colour is needed to tell it. */
const STATE_ICONS: Record<string, IconName> = {
  live: 'check',
  stale: 'warning',
  submerged: 'info',
  never_heard: 'help',
  mute: 'cross',
  port_closed: 'critical',
  unplugged: 'unplug',
};

export function stateIcon(state: string, carrier = ''): IconName {
  if (state === 'live' && isSatellite(carrier)) return 'info';
  return STATE_ICONS[state] ?? 'info';
}

/** State of a link as it is shown: a pulled plug overrules whatever else is known of it. */
export function shownState(link: Pick<RobotLink, 'state' | 'is_plugged'>): string {
  return link.is_plugged ? link.state : 'unplugged';
}

/** What it means that a radio's frames are signed, or not. */
export function signingHelp(link: Pick<RobotLink, 'is_signed'>): string {
  return link.is_signed
    ? 'Only frames signed with the key that robot and station share are believed.'
    : 'Nothing proves who speaks: whoever has such a radio can pose as the robot or the station.';
}

/** Whether a link carries words; an acoustic modem and cameras only measure where a robot is. */
export function speaks(link: Pick<RobotLink, 'kind'>): boolean {
  return link.kind !== 'acoustic' && link.kind !== 'camera';
}

/** Link by which a robot was heard last; what only measures brings no word of its own. */
export function lastHeard(links: readonly RobotLink[]): RobotLink | null {
  return links
    .filter((link) => link.heard_at !== null && speaks(link))
    .reduce<RobotLink | null>(
      (last, link) =>
        last === null || Date.parse(link.heard_at ?? '') > Date.parse(last.heard_at ?? '')
          ? link
          : last,
      null,
    );
}

/** Seconds since a link was heard; `null` if it never was. */
export function linkAge(link: RobotLink, nowMs: number): number | null {
  return link.heard_at === null ? null : Math.max(0, (nowMs - Date.parse(link.heard_at)) / 1000);
}

export function hasSatellite(links: readonly RobotLink[]): boolean {
  return links.some(({ kind }) => kind === 'satellite');
}

/** What the station would do without this link, before its plug is pulled. */
export function unplugText(
  robot: string,
  link: RobotLink,
  links: readonly RobotLink[],
  /** Names of the robots that share its port. */
  sharing: readonly string[] = [],
): string {
  const name = carrierName(link.carrier);
  if (link.kind === 'acoustic') {
    return `No range to ${robot} is measured until it is plugged in again. Orders and plans do not need it.`;
  }
  if (link.kind === 'camera') {
    return `Cameras neither look for ${robot} nor tell it where it is until they are plugged in again. Orders and plans do not need them.`;
  }
  const others = links.filter(
    (other) => other.uri !== link.uri && speaks(other) && other.is_plugged,
  );
  const rest =
    others.length > 0
      ? `${robot} is then reached only by ${others.map((other) => carrierName(other.carrier)).join(' and ')}.`
      : `No other link reaches ${robot}: neither orders, not even to surface, nor plans get through.`;
  if (link.kind === 'satellite') {
    return `The station hands nothing more to ${name} and takes nothing from it: the gateway keeps what ${robot} says and brings it later. What the gateway already has still reaches the robot. ${rest}`;
  }
  const too = sharing.length > 0 ? ` The same port serves ${sharing.join(' and ')}.` : '';
  return `The station closes the port and hears nothing by ${name}.${too} ${rest} ${robot} keeps the plan that it has.`;
}

const CARRIED: Record<string, string> = {
  telemetry: 'telemetry',
  plan: 'plans',
  position: 'positions',
  command: 'orders',
  surface: 'orders to surface',
  parameters: 'parameters',
  files: 'log files',
  range: 'ranges',
};

/** Kinds of messages as a person reads them. */
export function carriedText(kinds: readonly string[]): string {
  if (kinds.length === 0) return 'nothing now';
  // An order to surface is one of the orders.
  const told = kinds.includes('command') ? kinds.filter((kind) => kind !== 'surface') : kinds;
  return told.map((kind) => CARRIED[kind] ?? words(kind).toLowerCase()).join(', ');
}
