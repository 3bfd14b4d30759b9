/** Shapes of field maps, their comparison, and the 3D view; conventions as in `types.ts`. */

import type { Scores } from './survey_types';
import type { Time } from './types';

export interface FieldMap {
  robot: string;
  variable: string;
  title: string;
  unit: string;
  scale: 'linear' | 'log';
  model: string;
  axes: { x_m: number[]; y_m: number[]; z_m: number[] };
  /** North slowest, depth fastest; `null` where there is no water. */
  mean: (number | null)[];
  std: (number | null)[];
  /** Whether there is water; absent or `null`: everywhere. */
  mask?: boolean[] | null;
  samples: { total: number; per_fidelity: number[] };
  /** Samples whose position was corrected after a fix. */
  smoothed_samples?: number;
  models?: string[];
  updated_at: Time | null;
  scores: Scores | null;
}

export interface MapListing {
  variable: string;
  title: string;
  unit: string;
  /** The default first. */
  models: string[];
  /** What each model is called. */
  titles?: Record<string, string>;
  samples: number;
  updated_at: Time | null;
}

export interface ComparedModel {
  model: string;
  title: string;
  is_default: boolean;
  rmse: number | null;
  nlpd: number | null;
  wmse: number | null;
  coverage: number | null;
  log_marginal_likelihood: number | null;
}

/** Every model on the same samples. */
export interface MapComparison {
  state: 'none' | 'working' | 'ready';
  compared_at: Time | null;
  samples: number | null;
  against: 'truth' | 'held-out samples' | null;
  is_outdated: boolean;
  models: ComparedModel[];
  /** Why there are no scores, or why a model is missing. */
  message?: string;
  /** Job that works on it, where one does. */
  job?: string | null;
}

/** What learning the kernels found. */
export interface Learned {
  message?: string;
  before_nll?: number | null;
  after_nll?: number | null;
  /** A sentence for each kernel. */
  kernels?: string[];
  is_changed?: boolean;
}

/** What everybody sees in a robot's 3D view. */
export interface SceneView {
  quantity: 'mean' | 'std';
  form: 'volume' | 'slices';
  model: string;
  models: { key: string; title: string }[];
  /** Where the slices lie, as shares of the domain; `null` for a slice that is not drawn. */
  slice_depth: number | null;
  slice_north: number | null;
  slice_east: number | null;
  opacity: number;
  exaggeration: number;
  exaggeration_max: number;
  layers: SceneLayer[];
  /** What the colours of the map mean now. */
  legend: string;
  /** What the marks of the target mean; empty while nothing is shown of one. */
  target_legend: string;
}

export interface SceneLayer {
  key: string;
  title: string;
  visible: boolean;
  /** Whether there is something to show. */
  has_content: boolean;
}

export type SceneChange = Partial<
  Pick<
    SceneView,
    | 'quantity'
    | 'form'
    | 'model'
    | 'slice_depth'
    | 'slice_north'
    | 'slice_east'
    | 'opacity'
    | 'exaggeration'
  >
> & { layers?: Record<string, boolean> };
