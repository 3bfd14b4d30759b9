import type { Leg, Plan, Site, WaypointBody, WaypointMission } from '../../api/types';

export interface WaypointFault {
  /** Which row, from 0. */
  row: number;
  text: string;
}

/** What is wrong with waypoints before the station is asked; it knows the floor, too. */
export function faultsOf(rows: readonly WaypointBody[], site: Site): WaypointFault[] {
  return rows.flatMap((one, row) => {
    const name = `Waypoint ${row + 1}`;
    if (![one.north_m, one.east_m, one.depth_m, one.hold_s ?? 0].every(Number.isFinite)) {
      return [{ row, text: `${name} needs a number in each field.` }];
    }
    const { x_min_m, x_max_m, y_min_m, y_max_m } = site.water;
    const isNorthIn = one.north_m >= x_min_m && one.north_m <= x_max_m;
    if (!isNorthIn || one.east_m < y_min_m || one.east_m > y_max_m) {
      return [{ row, text: `${name} lies outside of ${site.name}.` }];
    }
    if (one.depth_m < 0) return [{ row, text: `${name} is above the surface.` }];
    if (one.depth_m > site.water.depth_max_m) {
      return [{ row, text: `${name} is deeper than the water, ${site.water.depth_max_m} m.` }];
    }
    return [];
  });
}

/** A waypoint as it is sent: what else an item on board asks for stays there. */
export function bodyOf({ north_m, east_m, depth_m, hold_s }: WaypointBody): WaypointBody {
  return { north_m, east_m, depth_m, hold_s: hold_s ?? 0 };
}

export function toneOf(state: WaypointMission['state']): string {
  if (state === 'on_board') return 'ok';
  return state === 'refused' ? 'alarm' : 'watch';
}

export interface Translated {
  rows: WaypointBody[];
  /** What of the plan waypoints cannot say, in sentences. */
  lost: string[];
}

/** What the station takes. */
const HOLD_MAX_S = 36_000;

const tenth = (value: number): number => Math.round(value * 10) / 10;

/** A plan of one of our robots as waypoints: the ends of its legs. */
export function fromPlan({ legs }: Pick<Plan, 'legs'>): Translated {
  const rows = legs.map(({ kind, duration_s, end_ned: [north, east, down] }) => ({
    north_m: tenth(north),
    east_m: tenth(east),
    depth_m: Math.max(0, tenth(down)),
    hold_s: kind === 'keep' ? Math.min(Math.round(duration_s), HOLD_MAX_S) : 0,
  }));
  const lost: string[] = [];
  const spirals = numbersOf(legs, 'spiral');
  const glides = numbersOf(legs, 'glide');
  if (spirals) lost.push(`Spirals become straight ways to their ends: leg ${spirals}.`);
  const stays = numbersOf(legs, 'keep');
  if (stays) lost.push(`Stays at the surface lose their radius, and end after 10 h: leg ${stays}.`);
  if (glides) lost.push(`Glides lose their angle and speed: leg ${glides}.`);
  lost.push(
    'Where the robot samples, and when it comes up by itself (uncertainty, time, battery), is not said.',
  );
  return { rows, lost };
}

/** The legs of a kind, such as "2, 5 and 3 more"; empty where there is none. */
function numbersOf(legs: readonly Leg[], kind: Leg['kind']): string {
  const all = legs.flatMap((leg, at) => (leg.kind === kind ? [at + 1] : []));
  const rest = all.length - 6;
  return all.slice(0, 6).join(', ') + (rest > 0 ? ` and ${rest} more` : '');
}
