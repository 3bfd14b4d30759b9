import type { JsonObject } from '../src/api/types';

function number(title: string, unit: string, value: number, more: JsonObject = {}): JsonObject {
  return { title, type: 'number', default: value, unit, advanced: false, ...more };
}

const degrees = { display_unit: 'deg' };

const TRIAL: JsonObject = {
  type: 'object',
  properties: {
    reference: {
      title: 'Reference',
      type: 'string',
      enum: ['linear_glide', 'sawtooth', 'diagonal', 'figure_eight', 'straight_glide'],
      default: 'linear_glide',
      description: 'The trajectory to track.',
    },
    duration_s: number('Duration', 's', 540, { exclusiveMinimum: 0, maximum: 36000 }),
    runs: { title: 'Seeds', type: 'integer', minimum: 1, maximum: 200, default: 8, unit: '' },
    start: {
      title: 'Start',
      type: 'object',
      default: { north_m: -3, east_m: -1.5, pitch_rad: 0 },
      properties: {
        north_m: number('North of the reference', 'm', -3),
        east_m: number('East of the reference', 'm', -1.5),
        pitch_rad: number('Pitch', 'rad', 0, degrees),
      },
    },
    disturbance: {
      title: 'Disturbance',
      type: 'object',
      default: { net_buoyancy_error_kg: 0, current_north_m_s: 0, actuator_rate_share: 1 },
      properties: {
        net_buoyancy_error_kg: number('Net buoyancy error', 'kg', 0, { display_unit: 'g' }),
        current_north_m_s: number('Current north', 'm/s', 0),
        actuator_rate_share: number('Rate of the sliding mass', '', 1, { exclusiveMinimum: 0 }),
      },
    },
  },
};

const TRIAL_VALUE: JsonObject = {
  reference: 'linear_glide',
  duration_s: 540,
  runs: 8,
  start: { north_m: -3, east_m: -1.5, pitch_rad: 0 },
  disturbance: { net_buoyancy_error_kg: 0, current_north_m_s: 0, actuator_rate_share: 1 },
};

const IDENTIFICATION: JsonObject = {
  type: 'object',
  properties: {
    method: {
      title: 'Method',
      type: 'string',
      enum: ['swarm', 'least_squares'],
      default: 'swarm',
    },
    particles: { title: 'Particles', type: 'integer', minimum: 2, default: 100, unit: '' },
    iterations: { title: 'Iterations', type: 'integer', minimum: 1, default: 60, unit: '' },
    inertia: number('Inertia', '', 0.72, { advanced: true }),
  },
};

const TRIM: JsonObject = {
  type: 'object',
  properties: {
    net_buoyancy_offset_kg: number('Net buoyancy offset', 'kg', 0, {
      display_unit: 'g',
      minimum: -0.3,
      maximum: 0.3,
    }),
    mass_position_offset_m: number('Mass position offset', 'm', 0, {
      display_unit: 'mm',
      minimum: -0.05,
      maximum: 0.05,
    }),
  },
};

const GAINS: JsonObject = {
  type: 'object',
  properties: {
    depth_gain: number('Depth gain', '1/s', 0.35, { minimum: 0 }),
    pitch_gain: number('Pitch gain', '1/s', 0.6, { minimum: 0 }),
    pitch_trade_rad: number('Pitch for horizontal error', 'rad', 0.35, degrees),
    speed_floor_m_s: number('Least speed', 'm/s', 0.01, { exclusiveMinimum: 0, advanced: true }),
  },
};

const GAIN_VALUES: JsonObject = {
  depth_gain: 0.35,
  pitch_gain: 0.6,
  pitch_trade_rad: 0.35,
  speed_floor_m_s: 0.01,
};

interface Kind {
  title: string;
  schema: JsonObject;
  value: JsonObject;
}

export const CONTROL_KINDS: Record<string, Kind> = {
  'controller.backstepping': {
    title: 'Backstepping',
    schema: GAINS,
    value: GAIN_VALUES,
  },
  'controller.baseline': {
    title: 'Baseline backstepping',
    schema: GAINS,
    value: { ...GAIN_VALUES, pitch_trade_rad: 0 },
  },
  'controller.governor': { title: 'Predictive backstepping', schema: GAINS, value: GAIN_VALUES },
  trial: { title: 'What-if scenario', schema: TRIAL, value: TRIAL_VALUE },
  identification: {
    title: 'Identification',
    schema: IDENTIFICATION,
    value: { method: 'swarm', particles: 100, iterations: 60, inertia: 0.72 },
  },
  trim: {
    title: 'Trim',
    schema: TRIM,
    value: { net_buoyancy_offset_kg: 0, mass_position_offset_m: 0 },
  },
};
