/** Shapes of plans, missions, transfers and maps; conventions as in `types.ts`. */

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
  credits: number;
}

export interface Violation {
  field: string;
  message: string;
}

export interface PlanProgress {
  elapsed_s: number;
  seconds_left: number;
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

export interface Plan {
  id: string;
  robot: string;
  kind: string;
  mission_id: string | null;
  round: number;
  state: PlanState;
  sha256: string | null;
  config_id: string | null;
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
}

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
}

export interface FieldMap {
  robot: string;
  variable: string;
  title: string;
  unit: string;
  scale: 'linear' | 'log';
  model: string;
  axes: { x_m: number[]; y_m: number[]; z_m: number[] };
  mean: (number | null)[];
  std: (number | null)[];
  samples: { total: number; per_fidelity: number[] };
  updated_at: Time | null;
  scores: Scores | null;
}

export interface MapListing {
  variable: string;
  title: string;
  unit: string;
  /** The default first. */
  models: string[];
  samples: number;
  updated_at: Time | null;
}
