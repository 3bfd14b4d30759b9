import type { Signing } from '../../api/types';
import type { Tone } from '../../text/word';

/** Whether a robot's radio is signed, as a person reads it. */
export const SIGNING_WORDS: Record<Signing['state'], { text: string; tone: Tone; help: string }> = {
  on: {
    text: 'Signed',
    tone: 'ok',
    help: 'Only frames signed with the key that robot and station share are believed.',
  },
  off: {
    text: 'Not signed: turned off',
    tone: 'watch',
    help: 'Whoever has such a radio can pose as the robot, or give it orders as this station.',
  },
  undecided: {
    text: 'Not signed: no key yet',
    tone: 'watch',
    help: 'Whoever has such a radio can pose as the robot, or give it orders as this station.',
  },
  unreadable: {
    text: 'The key cannot be read',
    tone: 'alarm',
    help: 'Nothing of this robot is believed by radio until the station can read its key, or it has a new one.',
  },
};

/** What follows from a new key, before it is made. */
export function newKeyText(robot: string, state: Signing['state']): string {
  const before =
    state === 'on'
      ? `${robot}’s present key ends at once.`
      : `What ${robot} says unsigned is refused from then on.`;
  return `${before} Until the new key is in the robot, nothing of it is believed by radio and it takes no order by radio, not even to surface. Do it with the robot at hand.`;
}

export function turnOffText(robot: string): string {
  return `Only for a robot that cannot sign. Whoever has such a radio can then pose as ${robot}, and give it orders as this station.`;
}

/** The key in groups of eight, as it is read aloud and typed. */
export function grouped(key: string): string[] {
  return key.match(/.{1,8}/g) ?? [];
}

/** An SVG path of the dark modules of a QR code, each a square of side 1. */
export function darkModules(rows: readonly string[]): string {
  return rows
    .flatMap((row, y) =>
      [...row.matchAll(/1+/g)].map(
        ({ 0: run, index: x }) => `M${x} ${y}h${run.length}v1h-${run.length}z`,
      ),
    )
    .join('');
}
