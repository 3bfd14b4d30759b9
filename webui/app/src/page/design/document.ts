/** Missions as people draw them, as the station keeps them: places north and east, m. */

import type {
  AlongIsobathOutput,
  AlongLineOutput,
  DesignView as StationView,
  ExpandingSquareOutput,
  LawnmowerOutput,
  MannerOutput,
  MooringOutput,
  ReferenceOutput,
  SectionOutput,
  SpiralOutOutput,
  Spot as StationSpot,
  StarOutput,
  StationKeepOutput,
  SurfacingRulesOutput,
  WaypointInput,
  WayOutput,
} from '../../api/generated/station';

export type Spot = StationSpot;
/** A place to come to, and how, where that is not as the design says. */
export type Waypoint = WaypointInput;
export type Manner = MannerOutput;
export type Motion = Manner['motion'];
export type SurfacingRules = SurfacingRulesOutput;

export type Way = Omit<WayOutput, 'waypoints'> & { readonly waypoints: readonly Waypoint[] };

export type Content =
  | Way
  | LawnmowerOutput
  | ExpandingSquareOutput
  | SpiralOutOutput
  | StarOutput
  | AlongLineOutput
  | AlongIsobathOutput
  | SectionOutput
  | MooringOutput
  | StationKeepOutput
  | ReferenceOutput;
export type ContentKind = Content['kind'];

export interface Design {
  readonly content: Content;
  readonly manner: Manner;
  readonly surfacing: SurfacingRules;
}

/** A design as the station has it. */
export type DesignView = Omit<StationView, 'document'> & { readonly document: Design };

/** Waypoints that a design may have. */
export const WAYPOINTS_MAX = 500;
const CORNERS_MAX = 256;

/** What the spots of a design are, and how many of them there may be. */
export interface SpotRule {
  /** One of them in words. */
  noun: string;
  shape: 'way' | 'area' | 'line' | 'place';
  least: number;
  most: number;
}

const AREA: SpotRule = { noun: 'corner', shape: 'area', least: 3, most: CORNERS_MAX };
const LINE: SpotRule = { noun: 'corner', shape: 'line', least: 2, most: CORNERS_MAX };
const PLACE: SpotRule = { noun: 'place', shape: 'place', least: 1, most: 1 };

const RULES: Record<ContentKind, SpotRule> = {
  waypoints: { noun: 'waypoint', shape: 'way', least: 0, most: WAYPOINTS_MAX },
  lawnmower: AREA,
  expanding_square: { ...PLACE, noun: 'centre' },
  spiral: { ...PLACE, noun: 'centre' },
  star: { ...PLACE, noun: 'centre' },
  along_line: LINE,
  along_isobath: PLACE,
  section: LINE,
  mooring: PLACE,
  station_keep: PLACE,
  reference: { ...PLACE, noun: 'origin' },
};

export function ruleOf(content: Content): SpotRule {
  return RULES[content.kind];
}

/** The places that people drag: waypoints, corners, or the one place of a pattern. */
export function spotsOf(content: Content): readonly Waypoint[] {
  switch (content.kind) {
    case 'waypoints':
      return content.waypoints;
    case 'lawnmower':
      return content.area;
    case 'along_line':
    case 'section':
      return content.line;
    case 'along_isobath':
      return [content.near];
    case 'mooring':
    case 'station_keep':
      return [content.place];
    case 'reference':
      return [content.origin];
    default:
      return [content.centre];
  }
}

/** The same content with other places. */
export function withSpots(content: Content, spots: readonly Waypoint[]): Content {
  if (content.kind === 'waypoints') return { ...content, waypoints: spots };
  const plain = spots.map(({ north_m, east_m }) => ({ north_m, east_m }));
  const [only = { north_m: 0, east_m: 0 }] = plain;
  switch (content.kind) {
    case 'lawnmower':
      return { ...content, area: plain };
    case 'along_line':
    case 'section':
      return { ...content, line: plain };
    case 'along_isobath':
      return { ...content, near: only };
    case 'mooring':
    case 'station_keep':
      return { ...content, place: only };
    case 'reference':
      return { ...content, origin: only };
    default:
      return { ...content, centre: only };
  }
}

/** A design with other places. */
export function placed(design: Design, spots: readonly Waypoint[]): Design {
  return { ...design, content: withSpots(design.content, spots) };
}

export const PLAIN_MANNER: Manner = {
  motion: 'glide',
  shallow_m: 0,
  deep_m: null,
  glide_angle_rad: null,
  glide_speed_m_s: null,
  swim_speed_m_s: null,
  floor_clearance_m: null,
};

export const PLAIN_SURFACING: SurfacingRules = {
  at_waypoints: true,
  every_s: null,
  at_utc: [],
  max_uncertainty_m: null,
  samples_waiting: null,
  on_value: [],
  hold_off_s: 600,
};

/** How a robot comes to a waypoint: what the waypoint says, else what the design says. */
export function mannerTo(waypoint: Waypoint, usual: Manner): Manner {
  const motion = waypoint.motion ?? usual.motion;
  const own = waypoint.speed_m_s ?? null;
  return {
    ...usual,
    motion,
    shallow_m: waypoint.shallow_m ?? usual.shallow_m,
    deep_m: waypoint.deep_m ?? usual.deep_m,
    glide_angle_rad: waypoint.glide_angle_rad ?? usual.glide_angle_rad,
    glide_speed_m_s: motion === 'glide' && own !== null ? own : usual.glide_speed_m_s,
    swim_speed_m_s: motion === 'swim' && own !== null ? own : usual.swim_speed_m_s,
  };
}

/** Whether two documents say the same. */
export function same(first: unknown, second: unknown): boolean {
  return JSON.stringify(sorted(first)) === JSON.stringify(sorted(second));
}

/** Without what is not said (`null`), and its members in one order. */
function sorted(value: unknown): unknown {
  if (Array.isArray(value)) return value.map(sorted);
  if (typeof value !== 'object' || value === null) return value;
  return Object.fromEntries(
    Object.entries(value)
      .filter(([, one]) => one !== null && one !== undefined && one !== '')
      .toSorted(([a], [b]) => (a < b ? -1 : 1))
      .map(([key, one]) => [key, sorted(one)]),
  );
}
