import type { JsonObject, NorthEast } from '../../api/types';
import { numberOf, textOf } from '../plan/config';
import type { Patience } from './phase';

/**
 * What keeps the target observable: the barrier, a predictive controller, nothing because the
 * mission teaches, or nothing because the controller is there to be compared with.
 */
export type Keeper = 'barrier' | 'predictive' | 'teaching' | 'comparison';

const KEEPERS: Record<string, Keeper> = { nominal: 'teaching', mpc_none: 'comparison' };

/** What settings have the target kept observable by; the barrier where they do not say. */
export function keeperOf(config: JsonObject | null | undefined): Keeper {
  const controller = textOf(config ?? undefined, 'barrier', 'controller');
  return KEEPERS[controller] ?? (controller.startsWith('mpc_') ? 'predictive' : 'barrier');
}

/** Whether the station will mark a plan of these settings as one that teaches. */
export function isTeaching(config: JsonObject | null | undefined): boolean {
  return keeperOf(config) === 'teaching';
}

const NEEDS_VIRTUAL = ['path', 'speed_m_s', 'heading_rad', 'width_m', 'period_s'];
const NEEDS_BARRIER = ['shape', 'epsilon', 'alpha', 'slope', 'fallback'];
const NEEDS_PURSUIT = ['heading_gain_per_s', 'distance_gain_per_s2', 'lead_m'];

/** Whether a field means anything beside what stands in the others. */
export function isNeeded(path: readonly string[], config: JsonObject): boolean {
  const [group = '', field = ''] = path;
  const kind = textOf(config, 'target', 'kind');
  const way = textOf(config, 'target', 'path');
  const controller = textOf(config, 'barrier', 'controller');
  if (group === 'target') {
    if (kind !== 'virtual') return !NEEDS_VIRTUAL.includes(field);
    if (field === 'address') return false;
    if (way === 'static') return !NEEDS_VIRTUAL.slice(1).includes(field);
    if (field === 'width_m') return way === 'sine' || way === 'circle';
    return field === 'period_s' ? way === 'sine' : true;
  }
  if (group === 'ranging' && field === 'sound_speed_m_s') return kind !== 'virtual';
  if (group === 'barrier' && controller !== 'barrier') {
    if (NEEDS_BARRIER.includes(field)) return false;
    return controller === 'nominal' || !NEEDS_PURSUIT.includes(field);
  }
  return true;
}

/** Determinant that must be kept, m²/s: the root of eps_B; `null` where nothing keeps it. */
export function determinantLevel(config: JsonObject | null | undefined): number | null {
  const epsilon = numberOf(config ?? undefined, 'barrier', 'epsilon');
  const isKept = textOf(config ?? undefined, 'barrier', 'controller') === 'barrier';
  return isKept && epsilon > 0 ? Math.sqrt(epsilon) : null;
}

/** Radius of the orbit around a target that stays, m: where the barrier and the turn rate meet. */
export function orbitRadius(config: JsonObject | null | undefined): number | null {
  const level = determinantLevel(config);
  const turn = numberOf(config ?? undefined, 'motion', 'turn_rate_max_rad_s');
  return level === null || turn <= 0 ? null : Math.sqrt(level / turn);
}

export function patienceOf(config: JsonObject | null | undefined): Patience | null {
  const lostAfterS = numberOf(config ?? undefined, 'ranging', 'lost_after_s');
  const giveUpAfterS = numberOf(config ?? undefined, 'ranging', 'give_up_after_s');
  return lostAfterS > 0 ? { lostAfterS, giveUpAfterS } : null;
}

/** Where the target is thought to be at first, and how far off that may be with 95 %, m. */
export interface Guess {
  at: NorthEast;
  radiusM: number;
}

/** Root of chi-squared of two degrees of freedom at 95 %. */
const SIGMAS_95 = 2.4477;

export function guessOf(config: JsonObject | null | undefined): Guess | null {
  const std = numberOf(config ?? undefined, 'target', 'guess_std_m');
  if (!config || std <= 0) return null;
  const at: NorthEast = [
    numberOf(config, 'target', 'north_m'),
    numberOf(config, 'target', 'east_m'),
  ];
  return { at, radiusM: std * SIGMAS_95 };
}

const TARGETS: Record<string, string> = {
  virtual: 'a virtual target',
  tag: 'an acoustic tag',
  beacon: 'an acoustic beacon',
};

/** What is followed, for a sentence; the address where it has one. */
export function targetName(config: JsonObject | null | undefined): string {
  const kind = textOf(config ?? undefined, 'target', 'kind');
  const name = TARGETS[kind] ?? 'a target';
  return kind === 'virtual' || kind === ''
    ? name
    : `${name} (address ${numberOf(config ?? undefined, 'target', 'address')})`;
}
