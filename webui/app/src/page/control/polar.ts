import type { Grid, Polar, SteadyMotion } from '../../api/types';
import type { ColourMapName } from '../../chart/colour_map';
import { fixed, screenUnit } from '../../text/unit';

/** What a polar tells at every net buoyancy and mass position. */
export type PolarKey =
  | 'speed_m_s'
  | 'glide_angle_rad'
  | 'vertical_speed_m_s'
  | 'horizontal_speed_m_s'
  | 'pitch_rad'
  | 'angle_of_attack_rad'
  | 'greatest_growth_per_s';

export interface PolarQuantity {
  key: PolarKey;
  title: string;
  help: string;
  unit: string;
  displayUnit: string | null;
  decimals: number;
  colours: ColourMapName;
}

const SPEED = quantity(
  'speed_m_s',
  'Speed',
  'm/s',
  'cm/s',
  1,
  'Through the water, along the path.',
);
const GLIDE_ANGLE = quantity(
  'glide_angle_rad',
  'Glide angle',
  'rad',
  'deg',
  1,
  'Of the path against the horizontal; negative goes down.',
);
const VERTICAL = quantity(
  'vertical_speed_m_s',
  'Vertical speed',
  'm/s',
  'cm/s',
  1,
  'Positive goes down, negative comes up.',
);
const PITCH = quantity('pitch_rad', 'Pitch', 'rad', 'deg', 1, 'Of the hull; nose up is positive.');
const STABILITY = quantity(
  'greatest_growth_per_s',
  'Stability',
  '1/s',
  null,
  3,
  'Growth of the slowest-dying disturbance: below 0 it dies away, above 0 it grows.',
  'cividis',
);

/** What the map can show. */
export const QUANTITIES: readonly PolarQuantity[] = [
  SPEED,
  GLIDE_ANGLE,
  VERTICAL,
  PITCH,
  STABILITY,
];

/** What is told of one glide. */
const ALL: readonly PolarQuantity[] = [
  SPEED,
  GLIDE_ANGLE,
  VERTICAL,
  quantity('horizontal_speed_m_s', 'Horizontal speed', 'm/s', 'cm/s', 1, 'Over the ground.'),
  PITCH,
  quantity('angle_of_attack_rad', 'Angle of attack', 'rad', 'deg', 1, 'Of the wings to the water.'),
  STABILITY,
];

export function quantityOf(key: PolarKey): PolarQuantity {
  return QUANTITIES.find((each) => each.key === key) ?? SPEED;
}

function quantity(
  key: PolarKey,
  title: string,
  unit: string,
  displayUnit: string | null,
  decimals: number,
  help: string,
  colours: ColourMapName = 'viridis',
): PolarQuantity {
  return { key, title, unit, displayUnit, decimals, help, colours };
}

/** Whether a robot can glide so: not at all, only with a controller's help, or by itself. */
export type Footing = 'impossible' | 'unstable' | 'stable';

export function footing(polar: Polar, row: number, column: number): Footing {
  const stable = polar.stable[row]?.[column] ?? null;
  if (stable === null || at(polar.speed_m_s, row, column) === null) return 'impossible';
  return stable ? 'stable' : 'unstable';
}

export const FOOTING_WORDS: Record<Footing, string> = {
  stable: 'stable: a disturbance dies away by itself',
  unstable: 'unstable: only a controller holds it',
  impossible: 'no steady glide here',
};

export function at(grid: Grid, row: number, column: number): number | null {
  return grid[row]?.[column] ?? null;
}

/** Values of one quantity as the screen shows them, row by row; holes are NaN. */
export function screenValues(polar: Polar, wanted: PolarQuantity): Float64Array {
  const { factor } = screenUnit(wanted.unit, wanted.displayUnit);
  const rows = polar[wanted.key];
  return Float64Array.from(
    polar.m0_kg.flatMap((_, row) =>
      polar.rp1_m.map((__, column) => (at(rows, row, column) ?? NaN) * factor),
    ),
  );
}

export interface Fact {
  title: string;
  text: string;
  help: string;
}

/** Every value of a cell with its unit. */
export function cellFacts(polar: Polar, row: number, column: number): Fact[] {
  return ALL.flatMap((each) => {
    const value = at(polar[each.key], row, column);
    return value === null ? [] : [{ title: each.title, text: shown(each, value), help: each.help }];
  });
}

export function shown(each: PolarQuantity, value: number): string {
  const unit = screenUnit(each.unit, each.displayUnit);
  return `${fixed(value * unit.factor, each.decimals)} ${unit.label}`;
}

/** What a steady motion is, in the order of the polar, and its turn where it has one. */
export function motionFacts(motion: SteadyMotion): Fact[] {
  const facts = ALL.flatMap((each) => {
    if (each.key === 'greatest_growth_per_s') return [];
    return [{ title: each.title, text: shown(each, motion[each.key]), help: each.help }];
  });
  const degrees = 180 / Math.PI;
  facts.push({
    title: 'Roll',
    text: `${fixed(motion.roll_rad * degrees, 1)} °`,
    help: 'Right wing down is positive.',
  });
  const { turn_rate_rad_s: rate, turn_radius_m: radius } = motion;
  facts.push({
    title: 'Turn',
    text:
      radius === null
        ? 'none, straight ahead'
        : `${fixed(rate * degrees, 2)} °/s, radius ${fixed(Math.abs(radius), 2)} m`,
    help: 'To starboard is positive.',
  });
  return facts;
}

/** How fast a disturbance of a motion dies away or grows. */
export function stabilitySentence(motion: Pick<SteadyMotion, 'stable' | 'eigenvalues'>): string {
  const growth = Math.max(...motion.eigenvalues.map(({ real }) => real));
  if (!Number.isFinite(growth) || growth === 0) return motion.stable ? 'Stable.' : 'Unstable.';
  const time = Math.LN2 / Math.abs(growth);
  const span = time >= 100 ? `${Math.round(time)} s` : `${fixed(time, 1)} s`;
  return motion.stable
    ? `Stable: a disturbance halves every ${span} at the slowest.`
    : `Unstable: a disturbance doubles every ${span}; only a controller holds it.`;
}

/** A steady glide as a point of the glider's polar. */
export interface PolarPoint {
  horizontal: number;
  vertical: number;
  isStable: boolean;
  row: number;
  column: number;
}

export interface PolarCurve {
  column: number;
  massPositionM: number;
  /** Runs without a hole, the lightest glide first. */
  runs: PolarPoint[][];
}

function point(polar: Polar, row: number, column: number): PolarPoint | null {
  const horizontal = at(polar.horizontal_speed_m_s, row, column);
  const vertical = at(polar.vertical_speed_m_s, row, column);
  if (horizontal === null || vertical === null) return null;
  const isStable = footing(polar, row, column) === 'stable';
  return { horizontal, vertical, isStable, row, column };
}

/** Curves of vertical against horizontal speed, one a mass position; about `count` of them. */
export function polarCurves(polar: Polar, count: number): PolarCurve[] {
  const known = polar.rp1_m.map((_, column) => curve(polar, column)).filter(({ runs }) => runs[0]);
  const step = Math.max(1, (known.length - 1) / Math.max(1, count - 1));
  const picked = new Set(
    Array.from({ length: Math.min(count, known.length) }, (_, i) => Math.round(i * step)),
  );
  return known.filter((_, i) => picked.has(i));
}

/** The curve of one mass position; a change of direction or a hole begins a new run. */
export function curve(polar: Polar, column: number): PolarCurve {
  const runs: PolarPoint[][] = [];
  let run: PolarPoint[] | null = null;
  polar.m0_kg.forEach((_, row) => {
    const here = point(polar, row, column);
    const last = run?.at(-1);
    const isTurned = here && last && Math.sign(here.vertical) !== Math.sign(last.vertical);
    if (here === null || isTurned) run = null;
    if (here === null) return;
    if (run === null) runs.push((run = []));
    run.push(here);
  });
  return { column, massPositionM: polar.rp1_m[column] ?? 0, runs };
}

/** The stable glide that goes furthest for the height it loses, or wins. */
export function bestGlide(polar: Polar, direction: 'down' | 'up'): PolarPoint | null {
  const sign = direction === 'down' ? 1 : -1;
  let best: PolarPoint | null = null;
  polar.m0_kg.forEach((_, row) =>
    polar.rp1_m.forEach((__, column) => {
      const here = point(polar, row, column);
      if (!here?.isStable || here.vertical * sign <= 0 || here.horizontal <= 0) return;
      if (best === null || reach(here) > reach(best)) best = here;
    }),
  );
  return best;
}

/** Metres forward for each metre of depth. */
export function reach(glide: PolarPoint): number {
  return glide.horizontal / Math.abs(glide.vertical);
}

/** Shares of the way to the heaviest and to the foremost at which any of these gliders glides. */
const USUAL_BUOYANCY = 4 / 9;
const USUAL_MASS = 0.45;

/** Inputs of a glide downwards that is neither steep nor feeble: 10 g and 20 mm of a miniglider. */
export function usualGlide({ m0_kg, rp1_m }: Pick<Polar, 'm0_kg' | 'rp1_m'>): {
  m0_kg: number;
  rp1_m: number;
} {
  const part = (ends: readonly number[], share: number) =>
    Number((Math.max(0, ends.at(-1) ?? 0) * share).toPrecision(2));
  return { m0_kg: part(m0_kg, USUAL_BUOYANCY), rp1_m: part(rp1_m, USUAL_MASS) };
}
