/**
 * What a design of waypoints will cost, worked out in the page while it is dragged.
 *
 * The station's check is what counts. The model here is the planner's account of its primitives
 * (`autonomy/planner/leg/primitive.py`) for a straight way of whole glides; the last answer of the
 * station scales it, so that between two answers only what was changed since is an estimate.
 */
import type { JsonObject } from '../../api/types';
import type { OutlineView } from '../../api/generated/station';
import { mannerTo, type Design, type Manner, type Spot, type Waypoint } from './document';

/** The planner's settings that the account is made from. */
export interface Rates {
  glideSpeed: number;
  swimSpeed: number;
  glideEnergy: number;
  swimFactor: number;
  timeFactor: number;
  tailAmplitude: number;
  tailFrequency: number;
  /** Time of a surfacing, s. */
  turnTime: number;
  fixStd: number;
  /** Growth of the position's error, m/√s. */
  drift: number;
  /** Deep turn and glide angle of a design that says none. */
  usualDeep: number;
  usualAngle: number;
}

/** The figures of a mission. */
export interface Figures {
  duration_s: number;
  energy: number;
  distance_m: number;
  surfacings: number;
  worst_std_m: number;
}

/** What the page cannot know by itself, from the station's last answer. */
export interface Account extends Figures {
  energy_wh: number | null;
  /** Part of a full battery. */
  battery_left: number | null;
  battery_after: BatteryAfter | null;
  satellite_bytes: number;
  credits: number | null;
}

/** What is left of the battery at the end. */
export type BatteryAfter = NonNullable<NonNullable<OutlineView['account']>['battery_after']>;

/** The swim to the first place, which is part of the station's account. */
export type WayThere = Pick<LegFigures, 'distance_m' | 'duration_s' | 'energy'>;

/**
 * Return what an account is made from.
 *
 * @param usual How the station flies what a design leaves open, of its last answer.
 */
export function ratesOf(
  planner: JsonObject,
  usual: Pick<OutlineView, 'usual_deep_m' | 'usual_angle_rad'>,
): Rates {
  const motion = planner.primitives as Record<string, number>;
  const energy = planner.energy as Record<string, number>;
  const mission = planner.mission as Record<string, number>;
  const filter = planner.position_filter as Record<string, number>;
  return {
    glideSpeed: motion.glide_speed_m_s ?? 0.05,
    swimSpeed: motion.swim_speed_m_s ?? 0.1,
    glideEnergy: energy.glide ?? 1.5,
    swimFactor: energy.swim_factor ?? 0.2,
    timeFactor: energy.time_factor ?? 0.005,
    tailAmplitude: energy.tail_amplitude_rad ?? 0.35,
    tailFrequency: energy.tail_frequency_hz ?? 1,
    turnTime: mission.turn_time_s ?? 20,
    fixStd: filter.fix_std_m ?? 0,
    drift: filter.drift_m_sqrt_s ?? 0,
    usualDeep: usual.usual_deep_m,
    usualAngle: usual.usual_angle_rad,
  };
}

/** One leg between two places. */
export interface LegFigures {
  distance_m: number;
  duration_s: number;
  energy: number;
}

/** Length, time and energy of the way from one place to the next. */
export function legFigures(rates: Rates, from: Spot, to: Spot, manner: Manner): LegFigures {
  const distance_m = Math.hypot(to.north_m - from.north_m, to.east_m - from.east_m);
  if (distance_m === 0) return { distance_m, duration_s: 0, energy: 0 };
  if (manner.motion === 'swim') {
    const duration_s = distance_m / (manner.swim_speed_m_s ?? rates.swimSpeed);
    return { distance_m, duration_s, energy: swimEnergy(rates, duration_s) };
  }
  const { slope, deep } = glideOf(rates, manner);
  const duration_s = (distance_m * slope) / (manner.glide_speed_m_s ?? rates.glideSpeed);
  const height = Math.max(1e-3, deep - manner.shallow_m);
  const glides = 2 * divesIn(distance_m * slope, height);
  const dives = manner.shallow_m <= 0 ? glides / 2 : 1;
  const atSurface = dives * rates.turnTime;
  return {
    distance_m,
    duration_s: duration_s + atSurface,
    energy: glides * rates.glideEnergy + rates.timeFactor * (duration_s + atSurface),
  };
}

/** How many times down and up a travel through depth is. */
function divesIn(travel: number, height: number): number {
  return Math.max(1, Math.ceil(travel / (2 * height) - 1e-9));
}

function glideOf(rates: Rates, manner: Manner): { slope: number; deep: number } {
  return {
    slope: Math.tan(manner.glide_angle_rad ?? rates.usualAngle),
    deep: manner.deep_m ?? rates.usualDeep,
  };
}

function swimEnergy(rates: Rates, duration_s: number): number {
  const { tailAmplitude, tailFrequency: f } = rates;
  const phase = 4 * Math.PI * f * duration_s;
  const work = 0.5 * Math.PI * tailAmplitude ** 2 * f * (Math.sin(phase) + phase);
  return rates.swimFactor * work + rates.timeFactor * duration_s;
}

/** The account of a way of waypoints from its first place on. */
export function estimate(rates: Rates, design: Design): Figures | null {
  if (design.content.kind !== 'waypoints') return null;
  const { waypoints, returns } = design.content;
  const [first] = waypoints;
  if (!first) return null;
  const all = returns ? [...waypoints, first] : waypoints;
  const sum: Figures = { duration_s: 0, energy: 0, distance_m: 0, surfacings: 0, worst_std_m: 0 };
  let under_s = 0;
  let longest_s = 0;
  for (let i = 1; i < all.length; i++) {
    const [from, to] = [all[i - 1] as Waypoint, all[i] as Waypoint];
    const manner = mannerTo(to, design.manner);
    const leg = legFigures(rates, from, to, manner);
    sum.duration_s += leg.duration_s;
    sum.energy += leg.energy;
    sum.distance_m += leg.distance_m;
    if (manner.motion === 'swim') continue;
    const { slope, deep } = glideOf(rates, manner);
    const dives = divesIn(leg.distance_m * slope, deep);
    const comesUp = to.surfaces ?? design.surfacing.at_waypoints;
    if (manner.shallow_m <= 0) {
      sum.surfacings += dives;
      longest_s = Math.max(longest_s, under_s + leg.duration_s / dives);
      under_s = 0;
    } else {
      under_s += leg.duration_s;
      longest_s = Math.max(longest_s, under_s);
      if (comesUp) {
        sum.surfacings += 1;
        under_s = 0;
      }
    }
  }
  sum.worst_std_m = Math.sqrt(rates.fixStd ** 2 + rates.drift ** 2 * longest_s);
  return sum;
}

/** The station's last answer, and what the model here said of the same document. */
export interface Checked {
  account: Account | null;
  model: Figures | null;
  wayThere: WayThere | null;
}

/** What is left where something takes another share of what it took. */
export function drained(after: BatteryAfter, share: number): BatteryAfter {
  const more = (share - 1) * after.used_wh.mean;
  const less = (range: BatteryAfter['left'], by: number) => ({
    mean: Math.max(0, range.mean - by),
    low: Math.max(0, range.low - by),
    high: Math.max(0, range.high - by),
  });
  return {
    ...after,
    left: less(after.left, more / after.capacity_wh),
    left_wh: less(after.left_wh, more),
    used_wh: less(after.used_wh, -more),
    home: after.home && less(after.home, more / after.capacity_wh),
  };
}

/** Column of the middle charge in a row of a band along time. */
const CHARGE = 11;

/** What flights ahead began and ended with, and along time. */
export interface FlownBand {
  battery_end: readonly [low: number, middle: number, high: number];
  over_time: readonly (readonly number[])[];
}

/** What a flight leaves of the charge of now, and back home, by what flights ahead drew. */
export function leftOfFlights(
  after: BatteryAfter,
  now: number,
  { battery_end: [low, mean, high], over_time }: FlownBand,
): Pick<BatteryAfter, 'left' | 'home'> {
  const gone = (over_time[0]?.[CHARGE] ?? now) - now;
  const without = (share: number) => ({
    mean: Math.max(0, mean - share),
    low: Math.max(0, low - share),
    high: Math.max(0, high - share),
  });
  const back = after.home && after.left.mean - after.home.mean;
  return {
    left: without(gone + after.there),
    home: back === null ? null : without(gone + after.there + back),
  };
}

/** The model's account in the measure of the station's last answer. */
export function scaledTo(now: Figures, checked: Checked | null): Account {
  const known = checked?.account ?? null;
  const before = checked?.wayThere ?? null;
  const ratio = (key: keyof Figures, fixed = 0) => {
    const model = checked?.model?.[key] ?? 0;
    const scale = known && model > 0 ? (known[key] - fixed) / model : 1;
    return fixed + scale * now[key];
  };
  const figures = {
    duration_s: ratio('duration_s', before?.duration_s),
    energy: ratio('energy', before?.energy),
    distance_m: ratio('distance_m'),
    surfacings: Math.round(ratio('surfacings')),
    worst_std_m: ratio('worst_std_m'),
  };
  const share = known && known.energy > 0 ? figures.energy / known.energy : 1;
  const ups = known && known.surfacings > 0 ? figures.surfacings / known.surfacings : 1;
  return {
    ...figures,
    energy_wh: typeof known?.energy_wh === 'number' ? known.energy_wh * share : null,
    battery_left: known?.battery_left ?? null,
    battery_after: known?.battery_after ? drained(known.battery_after, share) : null,
    satellite_bytes: Math.round((known?.satellite_bytes ?? 0) * ups),
    credits: known?.credits ?? null,
  };
}
