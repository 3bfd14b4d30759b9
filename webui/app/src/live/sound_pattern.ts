import type { AlarmLevel } from '../api/types';

/** What is heard: an alarm of a level, or somebody who asks for control of a robot. */
export type SoundKind =
  Extract<AlarmLevel, 'watch' | 'warning' | 'severe' | 'critical'> | 'request';

/** One tone of a pattern. */
export interface Tone {
  /** After the pattern began, s. */
  at: number;
  /** Hz. */
  pitch: number;
  /** s */
  length: number;
}

/**
 * Patterns that differ in rhythm as well as in pitch, so that they are told apart by ears that
 * hear high tones badly and through the noise of a deck: more tones and faster is graver.
 */
export const PATTERNS: Readonly<Record<SoundKind, readonly Tone[]>> = {
  watch: [{ at: 0, pitch: 520, length: 0.25 }],
  warning: [
    { at: 0, pitch: 660, length: 0.2 },
    { at: 0.35, pitch: 660, length: 0.2 },
  ],
  severe: [0, 0.28, 0.56].map((at) => ({ at, pitch: 780, length: 0.2 })),
  critical: [0, 0.18, 0.36, 0.7, 0.88].map((at, tone) => ({
    at,
    pitch: tone < 3 ? 880 : 700,
    length: 0.14,
  })),
  request: [
    { at: 0, pitch: 440, length: 0.18 },
    { at: 0.22, pitch: 587, length: 0.3 },
  ],
};

/** Time between two patterns while nobody has acknowledged, ms; what is not named sounds once. */
export const REPEATS_MS: Partial<Record<SoundKind, number>> = { severe: 20_000, critical: 5_000 };

/** Alarms in the order in which they sound, the gravest first. */
const AUDIBLE: readonly AlarmLevel[] = ['critical', 'severe', 'warning', 'watch'];

interface Unseen {
  id: string;
  raised_at: string;
  level: AlarmLevel;
}

/** The gravest sound that these alarms make together; `null` for silence. */
export function soundOf(alarms: readonly Unseen[]): SoundKind | null {
  const level = AUDIBLE.find((one) => alarms.some((alarm) => alarm.level === one));
  return (level as SoundKind | undefined) ?? null;
}

/** Alarms that were not there before, or are graver, or were raised again. */
export function freshOf<Alarm extends Unseen>(
  known: ReadonlySet<string>,
  alarms: readonly Alarm[],
): readonly Alarm[] {
  return alarms.filter((alarm) => !known.has(keyOf(alarm)));
}

export function keyOf({ id, raised_at, level }: Unseen): string {
  return `${id} ${raised_at} ${level}`;
}

/** Title of the browser's tab. */
export function tabTitle(title: string, unseen: number): string {
  return `${unseen > 0 ? `(${unseen}) ` : ''}${title} · Grace Ground Station`;
}
