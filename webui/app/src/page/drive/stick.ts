/** Where a pilot holds the stick, out of keys, fingers and gamepads; each axis -1 to 1. */

export interface Stick {
  /** Ahead is positive. */
  forward: number;
  /** To starboard is positive. */
  turn: number;
  /** Upward is positive. */
  up: number;
}

export const CENTRE: Stick = { forward: 0, turn: 0, up: 0 };
/** Part of a gamepad's axis that counts as the middle: no stick rests exactly there. */
export const DEAD_ZONE = 0.15;
export const STOP_KEYS: readonly string[] = ['Escape', ' '];

const KEYS: Readonly<Record<string, Partial<Stick>>> = {
  ArrowUp: { forward: 1 },
  w: { forward: 1 },
  ArrowDown: { forward: -1 },
  s: { forward: -1 },
  ArrowLeft: { turn: -1 },
  a: { turn: -1 },
  ArrowRight: { turn: 1 },
  d: { turn: 1 },
  PageUp: { up: 1 },
  r: { up: 1 },
  PageDown: { up: -1 },
  f: { up: -1 },
  /** Steers nowhere: it is held to stay at a depth. */
  h: {},
};

/** What the keys do, for the sheet of keys. */
export const DRIVE_KEYS: readonly (readonly [key: string, meaning: string])[] = [
  ['↑ W', 'Ahead'],
  ['↓ S', 'Astern'],
  ['← A', 'To port'],
  ['→ D', 'To starboard'],
  ['PageUp R', 'Up'],
  ['PageDown F', 'Down'],
  ['H', 'Stay at its depth'],
  ['Esc Space', 'Stop'],
];

/** The name under which a key steers; `null` for one that does not. */
export function steeringKey(key: string): string | null {
  const name = key.length === 1 ? key.toLowerCase() : key;
  return Object.hasOwn(KEYS, name) ? name : null;
}

/** Keys that are held at once add up; opposite ones cancel each other. */
export function ofKeys(held: Iterable<string>): Stick {
  let { forward, turn, up } = CENTRE;
  for (const key of held) {
    const axes = KEYS[key] ?? {};
    forward += axes.forward ?? 0;
    turn += axes.turn ?? 0;
    up += axes.up ?? 0;
  }
  return { forward: within(forward), turn: within(turn), up: within(up) };
}

/** A finger on the round field: right and down of its middle as parts of its radius. */
export function ofFinger(right: number, down: number): { forward: number; turn: number } {
  const reach = Math.max(1, Math.hypot(right, down));
  return { forward: -down / reach, turn: right / reach };
}

/** Axes of a gamepad as the standard mapping numbers them: left stick drives, right one dives. */
export function ofGamepad(axes: readonly number[]): Stick {
  const [right = 0, down = 0, , sink = 0] = axes;
  return { forward: live(-down), turn: live(right), up: live(-sink) };
}

export function isAlike(one: Stick, other: Stick): boolean {
  return one.forward === other.forward && one.turn === other.turn && one.up === other.up;
}

export function isCentre(stick: Stick): boolean {
  return isAlike(stick, CENTRE);
}

/** A stick that reaches no farther than a share of its way. */
export function limited(stick: Stick, share: number): Stick {
  return { forward: share * stick.forward, turn: share * stick.turn, up: stick.up };
}

/** The axis without its dead zone, from which it begins at 0. */
function live(axis: number): number {
  const beyond = Math.abs(axis) - DEAD_ZONE;
  return beyond <= 0 ? 0 : within((Math.sign(axis) * beyond) / (1 - DEAD_ZONE));
}

function within(axis: number): number {
  return Math.min(1, Math.max(-1, axis));
}
