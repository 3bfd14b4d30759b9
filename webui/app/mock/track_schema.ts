import type { Json, JsonObject } from '../src/api/types';

function number(title: string, unit: string, value: number, more: JsonObject = {}): JsonObject {
  return { title, type: 'number', default: value, unit, advanced: false, ...more };
}

function choice(title: string, values: string[], more: JsonObject = {}): JsonObject {
  const [first = ''] = values;
  return {
    title,
    type: 'string',
    enum: values,
    default: first,
    unit: '',
    advanced: false,
    ...more,
  };
}

function group(title: string, properties: Record<string, JsonObject>): JsonObject {
  const entries = Object.entries(properties).map(([key, field]): [string, Json] => [
    key,
    field.default ?? null,
  ]);
  return { title, type: 'object', properties, default: Object.fromEntries(entries) };
}

const degrees = { display_unit: 'deg' };
const hidden = { advanced: true };
const above = { exclusiveMinimum: 0 };

const TARGET = group('Target', {
  kind: choice('Target', ['virtual', 'tag', 'beacon'], {
    description: 'A virtual target, which the robot computes itself, a tag, or a beacon.',
  }),
  address: number('Acoustic address', '', 10, { type: 'integer', minimum: 1, maximum: 127 }),
  depth_m: number('Target depth', 'm', 0, { minimum: 0 }),
  north_m: number('Target north', 'm', 1.4),
  east_m: number('Target east', 'm', 0.7),
  guess_std_m: number('First guess is right within', 'm', 0.35, above),
  path: choice('Virtual path', ['circle', 'static', 'line', 'sine']),
  speed_m_s: number('Virtual speed', 'm/s', 0.01, { minimum: 0 }),
  heading_rad: number('Virtual heading', 'rad', 0, degrees),
  width_m: number('Path width', 'm', 0.3, above),
  period_s: number('Sine period', 's', 120, { ...above, ...hidden }),
});

const RANGING = group('Ranging', {
  period_s: number('Time between ranges', 's', 0.5, above),
  variance_m2: number('Range noise', 'm2', 0.1, above),
  gate: number('Outlier gate', '', 4, { ...above, ...hidden }),
  sound_speed_m_s: number('Sound speed', 'm/s', 1500, hidden),
  coast_after_s: number('Coasting after', 's', 3, above),
  lost_after_s: number('Lost after', 's', 15, above),
  give_up_after_s: number('Give up after', 's', 120, above),
});

const FILTER = group('Filter', {
  hypotheses: choice('Hypotheses', ['two', 'one', 'cloud'], {
    description: 'Two also follows the mirrored estimate, until the robot turns.',
  }),
  target_velocity: choice('Target velocity', ['estimated', 'known']),
});

const BARRIER = group('Barrier', {
  controller: choice('Controller', [
    'barrier', 'nominal', 'mpc_none', 'mpc_trace', 'mpc_determinant', 'mpc_condition',
  ]),
  epsilon: number('Barrier level (eps_B)', 'm4/s2', 0.0065, above),
  slope: number('Slope', '1/s', 0.13, above),
  heading_gain_per_s: number('Heading gain (k_psi)', '1/s', 1, above),
  distance_gain_per_s2: number('Distance gain (k_rho)', '1/s2', 0.1, above),
  fallback: choice('When it cannot be kept', ['best_effort', 'nominal'], hidden),
  lead_m: number('Lead (epsilon)', 'm', 0.25, hidden),
}); // prettier-ignore

const MOTION = group('Motion', {
  turn_rate_max_rad_s: number('Most turn rate', 'rad/s', Math.PI / 4, {
    ...above,
    display_unit: 'deg/s',
  }),
  acceleration_max_m_s2: number('Most acceleration', 'm/s2', 0.01, above),
  speed_max_m_s: number('Speed cap', 'm/s', 0.6, above),
  margin_m: number('Distance from walls and shore', 'm', 0.3, { minimum: 0 }),
  duration_s: number('Duration', 's', 600, { ...above, maximum: 86400 }),
});

const GROUPS = {
  target: TARGET,
  ranging: RANGING,
  filter: FILTER,
  barrier: BARRIER,
  motion: MOTION,
};

export const TRACKING_SCHEMA: JsonObject = {
  type: 'object',
  title: 'TrackingConfig',
  properties: GROUPS,
};

export const TRACKING_VALUE: JsonObject = Object.fromEntries(
  Object.entries(GROUPS).map(([key, { default: value }]) => [key, value ?? null]),
);

/** What the fake lake robot is told: a wandering tag and a wider, slower orbit. */
export const LAKE_TRACKING: JsonObject = {
  ...TRACKING_VALUE,
  target: {
    ...(TARGET.default as JsonObject),
    kind: 'tag',
    depth_m: 3,
    north_m: 270,
    east_m: 235,
    guess_std_m: 8,
  },
  barrier: { ...(BARRIER.default as JsonObject), epsilon: 6 },
  motion: {
    ...(MOTION.default as JsonObject),
    turn_rate_max_rad_s: 0.06,
    margin_m: 10,
    duration_s: 1800,
  },
};
