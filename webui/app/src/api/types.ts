/**
 * Shapes of the station's REST and live interface.
 *
 * SI units with a suffix, angles in radians, positions north-east-down in the site's frame, times
 * RFC 3339 UTC. A field that the station may leave out is optional; one that it may not know is
 * `null`.
 */

import type { RobotLink } from './link_types';
import type { Mission, Plan, Scores } from './survey_types';
import type { TrackView } from './track_types';

export * from './control_types';
export * from './link_types';
export * from './map_types';
export * from './survey_types';
export * from './track_types';

export type Ned = readonly [north: number, east: number, down: number];
export type Time = string;

export type Json = null | boolean | number | string | Json[] | JsonObject;
export interface JsonObject {
  [key: string]: Json;
}

export interface Box {
  x_min_m: number;
  x_max_m: number;
  y_min_m: number;
  y_max_m: number;
  depth_max_m: number;
}

/** A polygon in the site's frame; north and east of each corner. */
export interface Area {
  name: string;
  corners_m: [number, number][];
}

/** Depth of the floor on a grid, bilinear between; a row a northing. */
export interface Bathymetry {
  north_m: number[];
  east_m: number[];
  depth_m: number[][];
}

export interface Site {
  name: string;
  kind: 'tank' | 'lake' | 'sea';
  water: Box;
  domain: Box;
  origin_latitude_deg: number;
  origin_longitude_deg: number;
  radio_under_water: boolean;
  variable: string;
  /** The water lies inside. */
  shoreline?: Area | null;
  bathymetry?: Bathymetry | null;
}

export interface Link {
  carrier: string;
  state: string;
  heard_at: Time | null;
  age_s: number | null;
  rssi_dbm: number | null;
  frames_received: number;
  frames_bad: number;
}

export interface NextContact {
  at: Time | null;
  text: string;
}

export type AlarmLevel = 'normal' | 'info' | 'watch' | 'warning' | 'critical';

export interface Robot {
  id: string;
  name: string;
  /** Title of its vehicle. */
  model: string;
  /** Key of its vehicle in the catalogue. */
  model_key: string;
  model_note: string;
  kind: 'real' | 'simulated' | 'recorded';
  system_id: number | null;
  simulated: boolean;
  site: Site;
  link: Link;
  mode: string | null;
  activity: string;
  mission_id: string | null;
  plan_id: string | null;
  next_contact: NextContact | null;
  surface_forecast: string;
  alarm_level: AlarmLevel | null;
}

export interface Channel {
  value: number;
  unit: string;
  display_unit?: string | null;
  measured_at: Time;
  received_at: Time;
  age_s: number;
  limit_s: number;
}

export interface Position {
  ned_m: Ned;
  std_m: number;
  latitude_deg: number;
  longitude_deg: number;
  has_fix: boolean;
  measured_at: Time;
  received_at: Time;
  age_s: number;
}

export interface OnboardPlan {
  plan_id: string | null;
  sha256: string | null;
  state: string;
  leg: number;
  legs: number;
  age_s: number;
}

export interface RobotState {
  robot: string;
  channels: Record<string, Channel>;
  position: Position | null;
  mode: string | null;
  activity: string;
  plan: OnboardPlan | null;
  link: Link;
  /** Every link of it; `link` is the one that reaches it best. */
  links?: RobotLink[];
  /** What is wrong with its clock; its values are then in the order of their arrival. */
  clock_fault?: string | null;
  /** Its hold on the target that it follows, as it said last. */
  tracking?: TrackView | null;
}

/** What a live tick says of one robot: its state, and what the robot list would say now. */
export type LiveRobot = RobotState &
  Partial<
    Pick<
      Robot,
      'surface_forecast' | 'next_contact' | 'alarm_level' | 'mission_id' | 'plan_id' | 'site'
    >
  >;

export interface Samples {
  robot: string;
  channel: string;
  unit: string;
  measured_at: Time[];
  value: (number | null)[];
  decimated: boolean;
  /** Where each was taken, where positions were asked for. */
  north_m?: (number | null)[] | null;
  east_m?: (number | null)[] | null;
  depth_m?: (number | null)[] | null;
  fidelity?: (number | null)[] | null;
  /** Whether its position was corrected after the dive. */
  smoothed?: boolean[] | null;
}

export interface Track {
  robot: string;
  measured_at: Time[];
  north_m: number[];
  east_m: number[];
  depth_m: number[];
  std_m: number[];
  fidelity: (number | null)[];
  /** Whether it floated at the surface there with nothing to fly. */
  adrift?: boolean[];
  latitude_deg: number[];
  longitude_deg: number[];
}

export type CommandKind = 'surface' | 'hold' | 'resume' | 'quiet' | 'ping';
export type CommandLevelName = 'created' | 'queued' | 'radio' | 'applied' | 'refused' | 'expired';

export interface CommandLevel {
  level: CommandLevelName;
  at: Time;
  carrier: string;
  reason: string;
}

export interface Command {
  id: string;
  robot: string;
  kind: string;
  level: CommandLevelName;
  levels: CommandLevel[];
  created_at: Time;
  expires_at: Time | null;
  text: string;
}

export interface ConfigKind {
  kind: string;
  title: string;
  robots: string[];
}

export interface ConfigDocument {
  kind: string;
  robot: string | null;
  /** Version, or `null` while the preset holds. */
  id: string | null;
  value: JsonObject;
  /** What holds for this robot while nobody has stored anything. */
  preset: JsonObject;
  /** Gains of a controller for exact states. */
  simulation_preset?: JsonObject | null;
  /** How far it goes: used at the `station`, with a `mission` to the robot, or not on board. */
  reach?: 'station' | 'mission' | 'none';
  /** The same in a sentence. */
  reach_text?: string;
  changed_at: Time | null;
  changed_by: string | null;
}

export interface StationEvent {
  cursor: number;
  at: Time;
  kind: string;
  level: 'info' | 'watch' | 'warning' | 'critical';
  robot: string | null;
  text: string;
  data: JsonObject | null;
}

export interface EventPage {
  events: StationEvent[];
  next: number;
}

export interface Alarm {
  id: string;
  robot: string | null;
  level: AlarmLevel;
  text: string;
  state: 'unacknowledged' | 'acknowledged' | 'returned' | 'closed';
  raised_at: Time;
  acknowledged_at: Time | null;
  acknowledged_by: string | null;
  cleared_at: Time | null;
}

export interface Job {
  id: string;
  kind: string;
  state: 'queued' | 'running' | 'done' | 'failed' | 'cancelled';
  progress: number;
  message: string;
  result: JsonObject | null;
  created_at: Time;
  ended_at?: Time | null;
}

export interface ImportResult {
  deployment: string;
  rows: number;
  skipped: RowFault[];
  /** How many were skipped; only the first of them are named. */
  skipped_rows: number;
  scores: (Scores & { variable: string })[];
  without_map: { variable: string; reason: string }[];
}

export interface RowFault {
  line: number;
  reason: string;
}

export interface Deployment {
  id: string;
  name: string;
  robot: string;
  kind: 'live' | 'recorded';
  started_at: Time;
  ended_at: Time | null;
  variables: string[];
  samples: number;
  /** Name of the imported file; empty for a live one. */
  source: string;
  skipped_rows: number;
  scores: (Scores & { variable: string })[];
}

export type Role = 'viewer' | 'pilot' | 'admin';

export interface Person {
  name: string;
  role: Role;
  created_at: Time;
  disabled: boolean;
}

export interface Token {
  id: string;
  name: string;
  role: Role;
  created_at: Time;
  expires_at: Time;
  revoked_at: Time | null;
}

export interface NewToken {
  id: string;
  /** Shown once and never again. */
  token: string;
  expires_at: Time;
}

export interface Session {
  name: string;
  role: Role;
  rights: string[];
  /** `null` for who came with a token of their own. */
  csrf_token: string | null;
  expires_at: Time;
}

export interface Health {
  status: 'ok' | 'degraded';
  ready: boolean;
  /** Whether nobody can sign in yet because the station has no people. */
  first_start: boolean;
  simulation: boolean;
  version: string;
  storage: { ok: boolean; message: string };
  robots: number;
  clock: { now: Time; speed: number };
}

/** One batch of the live stream: what changed since the batch before; the first has all. */
export interface LiveTick {
  at: Time;
  cursor: number;
  robots?: Record<string, LiveRobot>;
  events?: StationEvent[];
  plans?: Record<string, Pick<Plan, 'state'> & Partial<Plan>>;
  missions?: Record<string, Partial<Mission>>;
  jobs?: Record<string, Partial<Job>>;
  alarms?: { unacknowledged: number };
}
