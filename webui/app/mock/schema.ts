import type { JsonObject } from '../src/api/types';
import { CONTROL_KINDS } from './control_schema';
import { TRACKING_SCHEMA, TRACKING_VALUE } from './track_schema';

const number = (title: string, unit: string, value: number, more: JsonObject = {}): JsonObject => ({
  title,
  type: 'number',
  default: value,
  unit,
  advanced: false,
  ...more,
});

const BOX: JsonObject = {
  type: 'object',
  title: 'Box',
  properties: {
    x_min_m: number('South edge (x)', 'm', 0, { description: 'Smallest northing of the box.' }),
    x_max_m: number('North edge (x)', 'm', 2.75),
    y_min_m: number('West edge (y)', 'm', 0),
    y_max_m: number('East edge (y)', 'm', 1.37),
    depth_max_m: number('Deepest', 'm', 0.65, { exclusiveMinimum: 0 }),
  },
};

const PLANNER: JsonObject = {
  $defs: { Box: BOX },
  type: 'object',
  title: 'PlannerConfig',
  properties: {
    domain: {
      $ref: '#/$defs/Box',
      title: 'Domain',
      description: 'The water to explore.',
      default: { x_min_m: 0, x_max_m: 2.75, y_min_m: 0, y_max_m: 1.37, depth_max_m: 0.65 },
    },
    total_budget: number('Total energy', '', 80, {
      exclusiveMinimum: 0,
      description: 'Energy units for the whole survey: a dive costs 1, a glide or spiral 1.5.',
    }),
    round_budget: number('Energy of a round', '', 20, { exclusiveMinimum: 0 }),
    objective: {
      title: 'Objective',
      type: 'string',
      enum: ['information_gain', 'ergodic'],
      default: 'information_gain',
      description: 'What makes a plan a good one.',
    },
    max_uncertainty_m: number('Maximum position uncertainty', 'm', 0.3, { exclusiveMinimum: 0 }),
    planning_time_s: number('Planning time', 's', 10, { exclusiveMinimum: 0, maximum: 600 }),
    fidelity_thresholds_m: {
      title: 'Fidelity thresholds',
      type: 'array',
      items: { type: 'number', exclusiveMinimum: 0 },
      minItems: 1,
      default: [0.1, 0.2],
      unit: 'm',
      description: 'Position uncertainties that divide the fidelity levels, ascending.',
    },
    glide_angle_rad: number('Glide angle', 'rad', 0.44, {
      display_unit: 'deg',
      exclusiveMinimum: 0,
      exclusiveMaximum: 1.5707963,
      advanced: true,
    }),
    seed: {
      title: 'Seed',
      anyOf: [{ type: 'integer', minimum: 0 }, { type: 'null' }],
      default: null,
      unit: '',
      advanced: true,
      description: 'Same seed, same plan.',
    },
    time_budget_s: number('Time budget of a round', 's', 0, { minimum: 0, display_unit: 'min' }),
    satellite_bytes: {
      title: 'Satellite bytes of a round',
      type: 'integer',
      minimum: 0,
      default: 0,
      unit: '',
    },
    target_std: number('Good enough', '', 0, {
      minimum: 0,
      description: 'Mean standard deviation at which the survey ends; 0 for never.',
    }),
    margin_m: number('Margin to keep-outs and shore', 'm', 0.1, { minimum: 0 }),
    floor_margin_m: number('Margin to the floor', 'm', 0.1, { minimum: 0 }),
    keep_outs: {
      title: 'Keep-outs',
      type: 'array',
      default: [],
      items: {
        type: 'object',
        properties: { name: { type: 'string' }, corners_m: { type: 'array' } },
      },
    },
    current: {
      title: 'Current',
      type: 'object',
      default: { north_m_s: 0, east_m_s: 0 },
      properties: {
        north_m_s: number('Current north', 'm/s', 0),
        east_m_s: number('Current east', 'm/s', 0),
      },
    },
    primitives: {
      title: 'Motion',
      type: 'object',
      advanced: true,
      default: { glide_angle_rad: 0.44, glide_speed_m_s: 0.025 },
      properties: {
        glide_angle_rad: number('Glide angle', 'rad', 0.44, { display_unit: 'deg' }),
        glide_speed_m_s: number('Glide speed', 'm/s', 0.025),
      },
    },
    energy: {
      title: 'Energy',
      type: 'object',
      advanced: true,
      default: { dive: 1 },
      properties: { dive: number('Cost of a dive', '', 1) },
    },
    reuse_candidates: {
      title: 'Reuse candidates',
      type: 'boolean',
      default: true,
      advanced: true,
      description: 'Keep good trajectories of the round before.',
    },
  },
};

const PID: JsonObject = {
  type: 'object',
  properties: Object.fromEntries(
    ['pitch', 'heading', 'depth'].flatMap((loop) =>
      ['p', 'i', 'd'].map((gain) => [
        `${loop}_${gain}`,
        number(`${loop.charAt(0).toUpperCase()}${loop.slice(1)}, ${gain.toUpperCase()}`, '', 1.2, {
          minimum: 0,
        }),
      ]),
    ),
  ),
};

const SATELLITE: JsonObject = {
  type: 'object',
  title: 'SatelliteConfig',
  properties: {
    credits_per_day: number('Credits a day', '', 100, {
      type: 'integer',
      minimum: 0,
      description: 'Nothing is sent beyond this budget, orders to surface aside.',
    }),
    price_per_credit: number('Price of a credit', '', 0.12, { minimum: 0 }),
    currency: { title: 'Currency', type: 'string', default: 'GBP' },
    expiry_h: number('Plans are given up after', 'h', 96, { exclusiveMinimum: 0 }),
    session_period_s: number('Time between sessions', 's', 1800, { display_unit: 'min' }),
    radio_silence_s: number('Radio silence before the satellite', 's', 600, { display_unit: 'min' }),
  },
}; // prettier-ignore

const ROUTES: JsonObject = {
  type: 'string',
  enum: ['auto', 'radio', 'satellite'],
  default: 'auto',
};
const LINK: JsonObject = {
  type: 'object',
  title: 'RoutingConfig',
  properties: {
    plan: { ...ROUTES, title: 'Plans', description: 'Automatic: radio while it reaches the robot.' },
    command: { ...ROUTES, title: 'Orders' },
  },
}; // prettier-ignore

export const KINDS: Record<string, { title: string; schema: JsonObject; value: JsonObject }> = {
  planner: {
    title: 'Planner',
    schema: PLANNER,
    value: {
      domain: { x_min_m: 0, x_max_m: 2.75, y_min_m: 0, y_max_m: 1.37, depth_max_m: 0.65 },
      total_budget: 80,
      round_budget: 20,
      objective: 'information_gain',
      max_uncertainty_m: 0.3,
      planning_time_s: 10,
      fidelity_thresholds_m: [0.1, 0.2],
      glide_angle_rad: 0.44,
      seed: null,
      reuse_candidates: true,
      time_budget_s: 1800,
      satellite_bytes: 2000,
      target_std: 0.2,
      margin_m: 0.1,
      floor_margin_m: 0.1,
      keep_outs: [
        {
          name: 'Ladder',
          corners_m: [
            [1.9, 1.0],
            [2.4, 1.0],
            [2.4, 1.3],
            [1.9, 1.25],
          ],
        },
      ],
      current: { north_m_s: 0.004, east_m_s: -0.002 },
      primitives: { glide_angle_rad: 0.44, glide_speed_m_s: 0.025 },
      energy: { dive: 1 },
    },
  },
  satellite: {
    title: 'Satellite',
    schema: SATELLITE,
    value: {
      credits_per_day: 100,
      price_per_credit: 0.12,
      currency: 'GBP',
      expiry_h: 96,
      session_period_s: 1800,
      radio_silence_s: 600,
    },
  },
  link: { title: 'Routing', schema: LINK, value: { plan: 'auto', command: 'auto' } },
  tracking: { title: 'Tracking', schema: TRACKING_SCHEMA, value: TRACKING_VALUE },
  ...CONTROL_KINDS,
  'controller.pid': {
    title: 'PID',
    schema: PID,
    value: Object.fromEntries(Object.keys(PID.properties as JsonObject).map((key) => [key, 1.2])),
  },
};
