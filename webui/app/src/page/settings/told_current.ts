import type { CurrentProposal, NewTold, ToldCurrent } from '../../api/types';
import { parseNumber } from '../../form/check';

type Told = NonNullable<ToldCurrent['told']>;
type Level = NonNullable<Told['levels']>[number];

/** One row of the form; numbers as text, as they are typed. */
export interface LevelDraft {
  depth: string;
  /** In cm/s. */
  speed: string;
  /** Whither the water goes, in degrees from north over east. */
  towards: string;
}

export interface ToldDraft {
  kind: 'constant' | 'profile';
  levels: LevelDraft[];
  /** Standard deviation per axis in cm/s; empty for the station's usual one. */
  std: string;
  source: string;
  /** How long it holds from now on in hours; 0 for always. */
  hours: number;
}

const HOUR_MS = 3_600_000;
const DEGREE = Math.PI / 180;
/** What is no number is refused by the station at its field. */
const isWithin = (typed: string, low: number, high: number) => {
  const value = parseNumber(typed);
  return value !== null && value >= low && value <= high;
};
const numberOf = (typed: string) => parseNumber(typed) ?? Number.NaN;

export const emptyLevel = (depth = '0'): LevelDraft => ({ depth, speed: '', towards: '' });

export const emptyDraft = (): ToldDraft => ({
  kind: 'constant',
  levels: [emptyLevel()],
  std: '',
  source: '',
  hours: 24,
});

/** A profile begins with two depths, a constant current has one row. */
export function ofKind(draft: ToldDraft, kind: ToldDraft['kind']): ToldDraft {
  const [first = emptyLevel(), ...others] = draft.levels;
  const below = others.length > 0 ? others : [emptyLevel('')];
  return { ...draft, kind, levels: kind === 'constant' ? [first] : [first, ...below] };
}

export function levelOf({ depth, speed, towards }: LevelDraft): Level {
  const [rate, angle] = [numberOf(speed) / 100, numberOf(towards) * DEGREE];
  return {
    depth_m: numberOf(depth),
    north_m_s: rate * Math.cos(angle),
    east_m_s: rate * Math.sin(angle),
  };
}

/** Speed in cm/s and direction in degrees of what is told at a depth. */
export function flowOf({ north_m_s, east_m_s }: Level): { speed: number; towards: number } {
  const towards = Math.round(Math.atan2(east_m_s, north_m_s) / DEGREE + 360) % 360;
  return { speed: 100 * Math.hypot(north_m_s, east_m_s), towards };
}

/** What is typed and cannot be, in words, the first one; empty where all is well. */
export function faultOf({ kind, levels, std }: ToldDraft): string {
  for (const [i, { depth, speed, towards }] of levels.entries()) {
    const where = kind === 'profile' ? `Row ${i + 1}: ` : '';
    if (kind === 'profile' && !isWithin(depth, 0, 12_000)) {
      return `${where}the depth must be a number of metres, 0 or more.`;
    }
    if (!isWithin(speed, 0, 300)) return `${where}the speed must be 0 to 300 cm/s.`;
    if (!isWithin(towards, 0, 360)) return `${where}the direction must be 0 to 360 degrees.`;
  }
  return std.trim() !== '' && !isWithin(std, 0.5, 100) ? 'Give or take 0.5 to 100 cm/s.' : '';
}

/** What the station is told of a typed current, from `now` on, ms since 1970. */
export function typedOf(draft: ToldDraft, now: number): NewTold {
  const end = draft.hours > 0 ? new Date(now + draft.hours * HOUR_MS).toISOString() : null;
  return {
    kind: draft.kind,
    levels: draft.levels.map(levelOf),
    ...stdOf(draft.std),
    source: draft.source.trim() || null,
    made_at: new Date(now).toISOString(),
    valid_until: end,
  };
}

/** What the station is told when a file's proposal is confirmed. */
export function confirmedOf({ proposal }: CurrentProposal, std: string): NewTold {
  return { proposal, ...stdOf(std) };
}

const stdOf = (std: string) => (std.trim() === '' ? {} : { std_m_s: numberOf(std) / 100 });
