/** Shapes of what concerns a robot's flying: vehicles, polars, what-if runs, identification, trim. */

import type { JsonObject, Time } from './types';

/** Rows of a grid; `null` where the vehicle has no steady glide. */
export type Grid<T = number> = readonly (readonly (T | null)[])[];

export interface VehicleListing {
  key: string;
  title: string;
  note: string;
  origin: 'built-in' | 'file' | 'identified';
  robots: string[];
  created_at: Time | null;
  created_by: string | null;
}

/** Steady straight glides with the tail straight; a row a net buoyancy, a column a mass position. */
export interface Polar {
  vehicle: string;
  title: string;
  note: string;
  m0_kg: readonly number[];
  rp1_m: readonly number[];
  speed_m_s: Grid;
  glide_angle_rad: Grid;
  pitch_rad: Grid;
  angle_of_attack_rad: Grid;
  vertical_speed_m_s: Grid;
  horizontal_speed_m_s: Grid;
  /** Largest real part of the eigenvalues; below 0 a disturbance dies away. */
  greatest_growth_per_s: Grid;
  stable: Grid<boolean>;
}

/** One steady motion; a spiral where the tail is held to a side. */
export interface SteadyMotion {
  pitch_rad: number;
  roll_rad: number;
  speed_m_s: number;
  glide_angle_rad: number;
  angle_of_attack_rad: number;
  vertical_speed_m_s: number;
  horizontal_speed_m_s: number;
  turn_rate_rad_s: number;
  turn_radius_m: number | null;
  stable: boolean;
  eigenvalues: readonly { real: number; imag: number }[];
}

export interface ControllerWish {
  kind: string;
  title?: string;
  config?: JsonObject;
}

export type RunState = 'queued' | 'running' | 'done' | 'failed' | 'cancelled' | 'interrupted';

export interface WhatIfListing {
  id: string;
  created_at: Time;
  created_by: string | null;
  state: RunState;
  /** Its controllers and its reference. */
  title: string;
  /** Whether the 3D view draws it now. */
  shown: boolean;
}

export interface WhatIf extends WhatIfListing {
  robot: string;
  scenario: JsonObject;
  controllers: readonly ControllerWish[];
  result: Comparison | null;
  /** Why it ended without a result. */
  message: string;
  /** What is odd about the scenario, such as a reference that leaves the water. */
  notices?: readonly string[];
  job: string | null;
}

export type Values = readonly (number | null)[];

export interface Band {
  low: Values;
  high: Values;
}

/** Controllers on the same seeds: medians over the seeds and the band that holds 90 % of them. */
export interface Comparison {
  time_s: readonly number[];
  reference: { north_m: Values; east_m: Values; depth_m: Values; pitch_rad: Values };
  runs: readonly ComparisonRun[];
  seeds: readonly number[];
  vehicle: string;
  note: string;
}

export interface ComparisonRun {
  kind: string;
  title: string;
  north_m: Values;
  east_m: Values;
  depth_m: Values;
  pitch_rad: Values;
  errors: { depth_m: Values; horizontal_m: Values; pitch_rad: Values; hybrid_rad: Values };
  band: { depth_m: Band; horizontal_m: Band; pitch_rad: Band };
  inputs: { m0_kg: Values; rp1_m: Values; delta_rad: Values };
  summary: ComparisonSummary;
}

export interface ComparisonSummary {
  depth_rms_m: number | null;
  horizontal_rms_m: number | null;
  horizontal_end_m: number | null;
  pitch_rms_rad: number | null;
  hybrid_rms_rad: number | null;
  travel: { m0_kg: number | null; rp1_m: number | null; delta_rad: number | null };
  energy_j: number | null;
}

export interface CostPoint {
  iteration: number;
  cost: number;
}

export interface Identification {
  id: string;
  robot: string;
  deployment: string;
  state: RunState;
  config: JsonObject;
  /** Moment of second 0 of the result. */
  data_start_at: Time;
  progress: number;
  message: string;
  convergence: readonly CostPoint[];
  /** Whether it would go on from where it was. */
  has_checkpoint: boolean;
  result: IdentificationResult | null;
  /** Key of the vehicle that it was kept as. */
  vehicle: string | null;
  created_at: Time;
  created_by: string | null;
  job: string | null;
}

export type IdentificationListing = Pick<Identification, 'id' | 'deployment' | 'state'> &
  Partial<Identification>;

export type Verdict = 'identified' | 'weak' | 'not identifiable' | 'fixed';

export interface IdentifiedParameter {
  name: string;
  title: string;
  unit: string;
  before: number | null;
  after: number | null;
  low: number | null;
  high: number | null;
  std: number | null;
  verdict: Verdict;
  reason: string;
}

/** A channel of the fit, such as `depth_m`. */
export type FitChannels = Readonly<Record<string, Values>>;

export interface LeftOut {
  kind: string;
  start_s: number;
  end_s: number;
  message: string;
}

/** Measured beside predicted. */
export interface Fit {
  time_s: readonly number[];
  measured: FitChannels;
  before: FitChannels | null;
  after: FitChannels;
}

export interface IdentificationResult {
  method: string;
  /** With the best actuator offsets; `null` where the model of before cannot follow. */
  cost_before: number | null;
  /** Whether the search had come to rest; if not, nothing is told of intervals. */
  is_converged?: boolean;
  cost_after: number;
  convergence: readonly CostPoint[];
  parameters: readonly IdentifiedParameter[];
  /** What the data cannot tell, in words, worst first. */
  findings?: readonly string[];
  fit: Fit;
  segments: readonly JsonObject[];
  left_out: readonly LeftOut[];
}

export interface TrimOffsets {
  net_buoyancy_offset_kg: number;
  mass_position_offset_m: number;
}

export interface TrimRmse {
  depth_rate_m_s: number;
  pitch_rad: number;
}

export interface TrimAdvice extends TrimOffsets {
  id: string;
  dives: number;
  net_buoyancy_std_kg: number | null;
  mass_position_std_m: number | null;
  /** Trim that it was given against. */
  present: TrimOffsets;
  rmse_now: TrimRmse | null;
  rmse_proposed: TrimRmse | null;
  /** What the trim would be after half a step. */
  half_step: TrimOffsets;
  full_step: TrimOffsets;
  message: string;
  is_worth_it: boolean;
}

/** Trim after an accepted step. */
export interface TrimAccepted extends TrimOffsets {
  config_id: string;
  /** When the robot will have it, in words. */
  reaches_robot: string;
}
