import type { Camera } from '../../api/types';
import type { IconName } from '../../part/Icon.svelte';
import type { Tone } from '../../text/word';

interface StateWord {
  text: string;
  tone: Tone;
  icon: IconName;
  /** What to do, where the station says nothing of its own. */
  help: string;
}

const STATES: Record<Camera['state'], StateWord> = {
  not_installed: {
    text: 'Needs the extra camera',
    tone: 'watch',
    icon: 'warning',
    help: 'Install the extra camera on the station and start it again.',
  },
  too_fast: {
    text: 'Clock too fast',
    tone: 'watch',
    icon: 'warning',
    help: 'Start the station with a slower clock.',
  },
  starting: { text: 'Starting', tone: 'plain', icon: 'info', help: '' },
  opening: { text: 'Opening', tone: 'plain', icon: 'info', help: '' },
  running: { text: 'Running', tone: 'ok', icon: 'check', help: '' },
  silent: {
    text: 'Silent',
    tone: 'alarm',
    icon: 'cross',
    help: 'Look at its power, its cable and its address. The station keeps trying.',
  },
  dark: {
    text: 'Dark',
    tone: 'watch',
    icon: 'warning',
    help: 'More light, from the side; or a longer exposure.',
  },
  glare: {
    text: 'Glare',
    tone: 'watch',
    icon: 'warning',
    help: 'Less light from above: lamps mirror themselves in the surface.',
  },
  failed: {
    text: 'Failed',
    tone: 'alarm',
    icon: 'cross',
    help: 'Look at its address.',
  },
};

export function stateWord({ state }: Pick<Camera, 'state'>): StateWord {
  return STATES[state];
}

/** What somebody should know or do, the gravest first; nothing twice. */
export function remarks(camera: Camera): string[] {
  const { words, advice, moved, missing } = camera;
  const told = words || stateWord(camera).help;
  return [...new Set([told, moved, advice, missing].filter(Boolean))];
}

/** How far its set-up is, in two words. */
export function setUpWord({ step, is_used }: Pick<Camera, 'step' | 'is_used'>): string {
  if (step === 'lens') return 'Uncalibrated';
  if (step === 'tags') return 'No fixed tags';
  if (step === 'pose') return 'Not placed';
  return is_used ? 'Used' : 'Left out';
}

const STANDS: Record<Camera['stand'], { text: string; tone: Tone }> = {
  holds: { text: 'where it was', tone: 'ok' },
  moved: { text: 'moved', tone: 'watch' },
  left_out: { text: 'moved, left out', tone: 'alarm' },
  unknown: { text: 'not known', tone: 'plain' },
};

/** Whether it still is where the calibration left it. */
export function standWord(camera: Pick<Camera, 'stand' | 'shift_px'>): {
  text: string;
  tone: Tone;
} {
  const { text, tone } = STANDS[camera.stand];
  return camera.stand === 'unknown'
    ? { text, tone }
    : { text: `${text}, ${camera.shift_px.toFixed(1)} px`, tone };
}

/** Time between exposure and arrival, and whether somebody measured it. */
export function latencyWord(camera: Pick<Camera, 'latency_s' | 'latency_std_s'>): string {
  if (camera.latency_s === null) return 'usual, not measured';
  const std = camera.latency_std_s === null ? '' : ` ± ${millis(camera.latency_std_s)}`;
  return `${millis(camera.latency_s)}${std} ms`;
}

function millis(seconds: number): string {
  return (1000 * seconds).toFixed(0);
}

/** Ids as a person reads them: 100 to 104, 110. */
export function idList(ids: readonly number[]): string {
  const runs: [number, number][] = [];
  for (const id of [...ids].sort((a, b) => a - b)) {
    const last = runs.at(-1);
    if (last && id === last[1] + 1) last[1] = id;
    else runs.push([id, id]);
  }
  const written = runs.flatMap(([first, last]) => {
    if (last - first >= 2) return [`${first} to ${last}`];
    return last === first ? [`${first}`] : [`${first}`, `${last}`];
  });
  return written.join(', ') || 'none';
}

/** Share of the focal length that is not known, as a person reads it. */
export function focalWord(share: number): string {
  return `focal length to ${(100 * share).toFixed(2)} %`;
}

/** How well a place is known; half a millimetre is no bold claim of nothing. */
export function withinWord(std_m: number): string {
  return `within ${Math.max(1, Math.round(1000 * std_m))} mm`;
}
