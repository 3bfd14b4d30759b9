/** Shapes of plans, missions and transfers; conventions as in `types.ts`. */

import type { TransferPart } from './link_types';
import type { TrackPlan } from './track_types';
import type { JsonObject, Ned, Time } from './types';

export type PrimitiveKind = 'glide' | 'spiral' | 'dive' | 'swim';

export interface Leg {
  kind: PrimitiveKind;
  start_ned: Ned;
  end_ned: Ned;
  speed_m_s: number;
  duration_s: number;
  energy: number;
  heading_rad: number;
  radius_m: number;
  turn_rad: number;
}

export interface Account {
  energy: number;
  duration_s: number;
  worst_std_m: number;
  bytes: number;
  /** What sending it by satellite takes; `null` where it is too long for that. */
  credits: number | null;
  /** How often the robot comes up. */
  surfacings?: number;
  /** What the round says by satellite. */
  satellite_bytes?: number;
  /** Of a plan that follows a target; `null` where the vehicle is not known. */
  battery?: Battery | null;
}

/** What a plan takes of the battery; all but the time are parts of a full one. */
export interface Battery {
  used: number;
  left: number | null;
  /** What is left when the robot ends its mission by itself. */
  reserve: number;
  /** How long the robot could go on like this. */
  lasts_s: number | null;
}

export interface Violation {
  field: string;
  message: string;
}

export interface PlanProgress {
  elapsed_s: number;
  seconds_left: number;
  waiting: string;
  objective: number | null;
  candidates: number;
}

export interface ObjectivePoint {
  elapsed_s: number;
  objective: number;
  candidates: number;
}

export interface RunnerUp {
  objective: number;
  energy: number;
  duration_s: number;
  worst_std_m: number;
  legs?: Leg[];
  points?: PlanPoint[];
}

/** Time s, north, east, down m, and the standard deviation that the robot would state, m. */
export type FlownPoint = readonly [number, number, number, number, number];

/** A draft flown through the full dynamics before it is offered. */
export interface Rehearsal {
  state: 'working' | 'done' | 'failed' | 'skipped';
  completed: boolean | null;
  /** Distance of where it was from where the plan says. */
  rms_error_m: number | null;
  worst_error_m: number | null;
  surfacing_error_m: number | null;
  /** Distance of where it was from where it believed to be, and the same as planned. */
  position_error_m?: number | null;
  predicted_error_m?: number | null;
  /** Part of the flight that was nearer to the plan than its 95 % circle says. */
  within_share?: number | null;
  runs?: number | null;
  duration_s: number | null;
  energy: number | null;
  flown: FlownPoint[];
  message: string;
}

export interface PlanLadder {
  draft_at: Time | null;
  sent_at: Time | null;
  on_board_at: Time | null;
  running_at: Time | null;
  ended_at: Time | null;
}

export type PlanState =
  | 'planning'
  | 'draft'
  | 'sent'
  | 'on_board'
  | 'running'
  | 'done'
  | 'failed'
  | 'superseded'
  | 'cancelled';

export interface Onboard {
  leg: number;
  legs: number;
  energy_used: number;
  /** Energy beyond the plan's account. */
  overspent?: number;
}

/** Time from the start s, north m, east m, down m, position standard deviation m. */
export type PlanPoint = readonly [number, number, number, number, number];

export interface Plan extends TrackPlan {
  id: string;
  robot: string;
  kind: string;
  mission_id: string | null;
  round: number;
  state: PlanState;
  sha256: string | null;
  config_id: string | null;
  /** Settings that it was planned with. */
  config?: JsonObject;
  /** Version of the trim that it brings on board; `null` for the preset. */
  trim_id?: string | null;
  created_at: Time;
  legs: Leg[];
  points: PlanPoint[];
  account: Account | null;
  objective: number | null;
  objective_unit: string;
  violations: Violation[];
  progress: PlanProgress | null;
  history: ObjectivePoint[];
  runners_up: RunnerUp[];
  message: string;
  ladder: PlanLadder;
  onboard: Onboard | null;
  rehearsal?: Rehearsal | null;
  stage?: 'waiting' | 'searching' | 'rehearsing' | null;
  /** Why a draft no longer fits its robot; empty while it does. */
  outdated?: Violation[];
  /** Its newest way to the robot. */
  transfer?: Transfer | null;
}

/** A plan as a list shows it. */
export type PlanListing = Pick<Plan, 'id' | 'robot' | 'kind' | 'state' | 'created_at' | 'ladder'>;

export interface MissionRound {
  round: number;
  plan_id: string;
  state: string;
  energy: number;
  objective: number | null;
}

export interface Budget {
  total: number;
  spent: number;
  round: number;
}

export interface Scores {
  model: string;
  title: string;
  rmse: number | null;
  nlpd: number | null;
  wmse: number | null;
  coverage_90: number | null;
  samples: number | null;
}

export type MissionState =
  'planning' | 'ready' | 'running' | 'replanning' | 'scoring' | 'done' | 'failed' | 'stopped';

export interface Mission {
  id: string;
  robot: string;
  kind: string;
  state: MissionState;
  automation: boolean;
  config: JsonObject;
  config_id: string | null;
  rounds: MissionRound[];
  budget: Budget;
  plan_id: string | null;
  scores: Scores[] | null;
  message: string;
  created_at: Time;
  /** Mean standard deviation of the map over the domain, in the model's scale. */
  map_std?: number | null;
  /** The survey ends when the map is as sure as this; 0 or absent: never for this reason. */
  target_std?: number | null;
  /** Share of exploitation now in force, 0 to 1. */
  exploitation?: number | null;
  /** Plan of the next round, made while the robot flies this one. */
  ahead?: string | null;
}

export interface Transfer {
  id: string;
  robot: string;
  plan_id: string;
  state: string;
  items_sent: number;
  items: number;
  bytes: number;
  level: string;
  started_at: Time;
  ended_at: Time | null;
  reason: string;
  carrier?: string;
  sha256?: string | null;
  expires_at?: Time | null;
  /** Spent on it so far. */
  credits?: number;
  /** Its messages, where it goes by satellite. */
  parts?: TransferPart[];
  can_withdraw?: boolean;
  /** What is known of it, a sentence. */
  text?: string;
}
