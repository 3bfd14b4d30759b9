type Pair = [number, number];

export interface PursuitState {
  /** Robot as seen from its target, north and east, m. */
  relative: Pair;
  heading: number;
  speed: number;
}

/** Determinant of the observability matrix of a target that stands still. */
function determinantOf({ relative: [x, y], heading, speed }: PursuitState): number {
  return speed * (x * Math.sin(heading) - y * Math.cos(heading));
}

/** Inverse condition number of the same. */
export function inverseCondition(relative: Pair, speed: number, heading: number): number {
  const twice = 2 * Math.abs(determinantOf({ relative, heading, speed }));
  const size = relative[0] ** 2 + relative[1] ** 2 + speed ** 2;
  return size === 0 ? 0 : twice / (size + Math.sqrt(Math.max(0, size ** 2 - twice ** 2)));
}

/** Turn rate and acceleration that lead straight to the target. */
export function pursued(
  { relative: [x, y], heading }: PursuitState,
  gain: { heading: number; distance: number; lead: number },
): Pair {
  const north = -x - gain.lead * Math.cos(heading);
  const east = -y - gain.lead * Math.sin(heading);
  const error = heading - Math.atan2(east, north);
  const wrapped = Math.atan2(Math.sin(error), Math.cos(error));
  return [
    -gain.heading * wrapped,
    gain.distance * 0.1 * Math.hypot(north, east) * Math.cos(wrapped),
  ];
}

/** The motion nearest to the wanted one that keeps the determinant above its level. */
export function kept(
  state: PursuitState,
  wanted: Pair,
  limits: { turn: number; push: number },
  law: { level: number; slope: number; isOn: boolean },
): { command: Pair; nominal: Pair; determinant: number; barrier: number; isFeasible: boolean } {
  const { relative: [x, y], heading, speed } = state; // prettier-ignore
  const determinant = determinantOf(state);
  const barrier = Math.abs(determinant) - law.level;
  const clip = ([turn, push]: Pair): Pair => [
    Math.max(-limits.turn, Math.min(limits.turn, turn)),
    Math.max(-limits.push, Math.min(limits.push, push)),
  ];
  const nominal = clip(wanted);
  const side = determinant < 0 ? -1 : 1;
  const slope: Pair = [
    side * speed * (x * Math.cos(heading) + y * Math.sin(heading)),
    side * (x * Math.sin(heading) - y * Math.cos(heading)),
  ];
  const rise = (u: Pair) => slope[0] * u[0] + slope[1] * u[1];
  const least = -law.slope * barrier;
  const at = (pull: number) => clip([wanted[0] + pull * slope[0], wanted[1] + pull * slope[1]]);
  const told = { nominal, determinant, barrier };
  if (!law.isOn || rise(nominal) >= least) return { ...told, command: nominal, isFeasible: true };
  const best = at(1e9);
  if (rise(best) < least) return { ...told, command: best, isFeasible: false };
  let [low, high] = [0, 1e6];
  for (let i = 0; i < 60; i++) {
    const middle = (low + high) / 2;
    if (rise(at(middle)) >= least) high = middle;
    else low = middle;
  }
  return { ...told, command: at(high), isFeasible: true };
}
