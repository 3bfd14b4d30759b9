/** Shapes of the following of a target by its range; conventions as in `types.ts`. */

import type { Violation } from './survey_types';
import type { JsonObject, Time } from './types';

export type TrackPhase = 'waiting' | 'tracking' | 'coasting' | 'lost' | 'ended';

export type NorthEast = readonly [north: number, east: number];

/** One place where the target may be, as the robot believes. */
export interface TargetHypothesis {
  position_ne_m: NorthEast;
  velocity_ne_m_s: NorthEast;
  /** Of the position: north-north, north-east, east-east. */
  covariance_m2: readonly [nn: number, ne: number, ee: number];
  /** Probability, 0..1; those of all hypotheses add up to 1. */
  weight: number;
}

/** Turn rate rad/s, positive to starboard, and acceleration m/s². */
export type Motion = readonly [turnRate: number, acceleration: number];

/** What a robot that follows a target said of its hold on it, and of what it did for it. */
export interface TrackView {
  measured_at: Time;
  received_at: Time;
  phase: TrackPhase;
  /** Where the robot believed to be itself. */
  position_ne_m: NorthEast;
  /** The likeliest first; none before the first range. */
  hypotheses: TargetHypothesis[];
  /** Newest horizontal range that was heard. */
  range_m: number | null;
  /** How old that range was when this was measured. */
  range_age_s: number;
  ranges_heard: number;
  ranges_rejected: number;
  determinant_m2_s: number;
  barrier: number;
  /** Inverse condition number of the observability matrix, 0..1. */
  inverse_condition: number;
  /** What the pursuit law wanted. */
  nominal: Motion;
  /** What the robot did. */
  command: Motion;
  /** Whether anything keeps the target observable; `false` is for teaching. */
  is_barrier_on: boolean;
  /** Whether the barrier could be kept at this step. */
  is_feasible: boolean;
  is_quiet: boolean;
  /** Where a virtual target was; `null` for a real one. */
  true_ne_m: NorthEast | null;
  /** Distance of the likeliest estimate from the truth. */
  error_m: number | null;
  /** Why the mission ended, in the robot's words; empty while it goes on. */
  reason: string;
  /** The same in a sentence. */
  text: string;
}

export interface TrackPage {
  robot: string;
  plan_id: string | null;
  /** The oldest first. */
  reports: TrackView[];
}

/** What a plan that follows a target says beyond other plans. */
export interface TrackPlan {
  /** Settings of the following; `null` for other plans. */
  tracking?: JsonObject | null;
  /** Seconds since the start, north and east, m: the way of a virtual target. */
  target_path?: readonly (readonly [t: number, north: number, east: number])[];
  /** What to know before it is sent; `teaching` marks one that teaches. */
  warnings?: Violation[];
  /** Whether it follows its target with nothing that keeps it observable, for teaching. */
  teaches?: boolean;
  /** Settings that nobody named for it and that are not the preset's. */
  inherited?: InheritedSetting[];
}

/** A setting that an earlier plan left. */
export interface InheritedSetting {
  /** Its path, such as `barrier.alpha`. */
  field: string;
  value: string | number;
  /** What the preset says. */
  usual: string | number;
}
