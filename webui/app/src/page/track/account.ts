import type { Battery, JsonObject } from '../../api/types';
import { duration } from '../../text/time';
import { plainNumber } from '../../text/unit';
import { numberOf, textOf } from '../plan/config';
import { guessOf, keeperOf, orbitRadius, patienceOf, targetName } from './config';

/** One line of what a plan to follow a target sets out to do. */
export interface Fact {
  title: string;
  text: string;
  help?: string;
}

/** What matters of a plan's settings before it is sent, in the order in which it is asked. */
export function trackFacts(config: JsonObject): Fact[] {
  const patience = patienceOf(config);
  const guess = guessOf(config);
  const depth = numberOf(config, 'motion', 'depth_m');
  return [
    { title: 'Follows', text: targetName(config) + way(config) },
    {
      title: 'First guess',
      text: guess
        ? `${unit(guess.at[0], 'm')} north, ${unit(guess.at[1], 'm')} east, ±${unit(guess.radiusM, 'm')}`
        : '–',
      help: 'Where the robot looks first, in the site’s frame, and how far off that may be (95 %).',
    },
    { title: 'At most for', text: duration(numberOf(config, 'motion', 'duration_s')) },
    { title: 'Swims', text: depth === 0 ? 'at the surface' : `${unit(depth, 'm')} deep` },
    { title: 'Keeps it observable', text: keeping(config) },
    { title: 'Range', text: `every ${unit(numberOf(config, 'ranging', 'period_s'), 's')}` },
    {
      title: 'Lost',
      text: patience
        ? `after ${duration(patience.lostAfterS)} of silence, given up ${duration(patience.giveUpAfterS)} later`
        : '–',
      help: 'How long the robot hears no range until it counts its target as lost, and how long it then searches.',
    },
  ];
}

function way(config: JsonObject): string {
  if (textOf(config, 'target', 'kind') !== 'virtual') return '';
  const speed = unit(numberOf(config, 'target', 'speed_m_s'), 'm/s');
  const width = unit(numberOf(config, 'target', 'width_m'), 'm');
  switch (textOf(config, 'target', 'path')) {
    case 'circle':
      return ` on a circle of ${width} radius, ${speed}`;
    case 'sine':
      return ` that swings ${width} to either side, ${speed}`;
    case 'line':
      return ` on a straight line, ${speed}`;
    default:
      return ' that stays';
  }
}

function keeping(config: JsonObject): string {
  const orbit = orbitRadius(config);
  switch (keeperOf(config)) {
    case 'teaching':
      return 'nothing (teaching)';
    case 'comparison':
      return 'nothing (for comparison)';
    case 'predictive':
      return 'a predictive controller';
    case 'barrier':
      return orbit === null ? 'the barrier' : `the barrier; orbit of about ${unit(orbit, 'm')}`;
  }
}

/** What a mission takes of the battery, against what there is. */
export function batteryText({
  used,
  left,
  reserve,
  lasts_s: lasts,
}: Pick<Battery, 'used' | 'left' | 'reserve' | 'lasts_s'>): string {
  const takes = `takes about ${percent(used)}`;
  if (left === null) return `${takes}; what is left is not known`;
  const kept = `of ${percent(left)} left, and keeps ${percent(reserve)}`;
  return lasts === null ? `${takes} ${kept}` : `${takes} ${kept}: lasts ${duration(lasts)}`;
}

function percent(share: number): string {
  return unit(share * 100, '%');
}

const DIGITS = 2;

/** A number with its unit, never parted from it. */
function unit(value: number, label: string): string {
  return `${plainNumber(value, Math.abs(value) < 1 ? DIGITS : DIGITS + 1)}\u00a0${label}`;
}
