import type {
  Comparison,
  ComparisonRun,
  ControllerWish,
  IdentificationResult,
  Polar,
  SteadyMotion,
} from '../src/api/types';

/** A glide that looks like one: flatter with the mass in the middle, faster with more buoyancy. */
export function steady(m0: number, rp1: number, delta = 0): SteadyMotion | null {
  const size = Math.abs(m0) / 0.05;
  const pitch = -Math.sign(m0) * 0.35 - rp1 * 22;
  if (size < 0.06 || Math.abs(pitch) > 1.25 || pitch * m0 > -0.004 * size) return null;
  const alpha = -Math.sign(pitch) * (0.16 / Math.max(Math.abs(pitch), 0.12)) * 0.5;
  const glide = pitch - alpha;
  const speed = 0.24 * Math.sqrt(size * Math.abs(Math.sin(glide)));
  const growth = Math.abs(pitch) < 0.32 && size > 0.5 ? 0.08 : -0.05 - 0.2 * size;
  const rate = 0.12 * delta * speed * 10;
  return {
    pitch_rad: pitch,
    roll_rad: -0.1 * delta,
    speed_m_s: speed,
    glide_angle_rad: glide,
    angle_of_attack_rad: alpha,
    vertical_speed_m_s: -speed * Math.sin(glide),
    horizontal_speed_m_s: speed * Math.cos(glide),
    turn_rate_rad_s: rate,
    turn_radius_m: rate === 0 ? null : (speed * Math.cos(glide)) / rate,
    stable: growth < 0,
    eigenvalues: [
      { real: growth, imag: 0 },
      { real: growth - 0.6, imag: 1.2 },
      { real: growth - 0.6, imag: -1.2 },
    ],
  };
}

export function fakePolar(vehicle: string, title: string, note: string): Polar {
  const m0_kg = Array.from({ length: 21 }, (_, i) => -0.05 + 0.005 * i);
  const rp1_m = Array.from({ length: 21 }, (_, i) => -0.03 + 0.003 * i);
  const grid = <T>(pick: (motion: SteadyMotion) => T): (T | null)[][] =>
    m0_kg.map((m0) =>
      rp1_m.map((rp1) => {
        const motion = steady(m0, rp1);
        return motion === null ? null : pick(motion);
      }),
    );
  return {
    vehicle,
    title,
    note,
    m0_kg,
    rp1_m,
    speed_m_s: grid((m) => m.speed_m_s),
    glide_angle_rad: grid((m) => m.glide_angle_rad),
    pitch_rad: grid((m) => m.pitch_rad),
    angle_of_attack_rad: grid((m) => m.angle_of_attack_rad),
    vertical_speed_m_s: grid((m) => m.vertical_speed_m_s),
    horizontal_speed_m_s: grid((m) => m.horizontal_speed_m_s),
    greatest_growth_per_s: grid((m) => m.eigenvalues[0]?.real ?? 0),
    stable: grid((m) => m.stable),
  };
}

export function fakeComparison(
  controllers: readonly ControllerWish[],
  durationS: number,
): Comparison {
  const time_s = Array.from({ length: 300 }, (_, i) => (i / 299) * durationS);
  const line = (pick: (t: number) => number) => time_s.map(pick);
  const runs = controllers.map(({ kind, title }, place): ComparisonRun => {
    const decay = 60 + 50 * place;
    const swing = (t: number) => (place === 0 ? 0 : 0.02 * place * Math.sin(t / (6 + place)));
    const horizontal = line((t) => 0.05 * place + 3.3 * Math.exp(-t / decay) + Math.abs(swing(t)));
    const depth = line(
      (t) => 0.02 * place + 0.4 * Math.exp(-t / decay) * Math.cos(t / 30) + swing(t),
    );
    const pitch = line((t) => 0.3 * Math.exp(-t / decay) * Math.sin(t / 20) + swing(t));
    const band = (values: number[]) => ({
      low: values.map((value) => value - 0.04 - 0.15 * Math.abs(value)),
      high: values.map((value) => value + 0.04 + 0.15 * Math.abs(value)),
    });
    const rms = (values: number[]) =>
      Math.sqrt(values.reduce((sum, value) => sum + value * value, 0) / values.length);
    return {
      kind,
      title: title ?? kind,
      north_m: line((t) => 0.1 * t - 3 * Math.exp(-t / decay)),
      east_m: line((t) => -1.5 * Math.exp(-t / decay)),
      depth_m: line((t) => 0.05 * t),
      pitch_rad: pitch,
      errors: { depth_m: depth, horizontal_m: horizontal, pitch_rad: pitch, hybrid_rad: pitch },
      band: { depth_m: band(depth), horizontal_m: band(horizontal), pitch_rad: band(pitch) },
      inputs: {
        m0_kg: line((t) => 0.02 + 0.01 * Math.exp(-t / decay) * Math.cos(t / 9)),
        rp1_m: line((t) => 0.008 + swing(t) / 4),
        delta_rad: line((t) => 0.4 * Math.exp(-t / decay) * Math.sin(t / 14)),
      },
      summary: {
        depth_rms_m: rms(depth),
        horizontal_rms_m: rms(horizontal),
        horizontal_end_m: horizontal.at(-1) ?? null,
        pitch_rms_rad: rms(pitch),
        hybrid_rms_rad: rms(pitch) * 1.2,
        travel: { m0_kg: 0.12 + 0.02 * place, rp1_m: 0.2 * (1 + place), delta_rad: 4 - place },
        energy_j: 140 - 12 * place,
      },
    };
  });
  const zero = line(() => 0);
  const depth_m = line((t) => 0.05 * t);
  return {
    time_s,
    reference: { north_m: line((t) => 0.1 * t), east_m: zero, depth_m, pitch_rad: zero },
    runs,
    seeds: [0, 1, 2, 3, 4, 5, 6, 7],
    vehicle: 'miniglider',
    note: '',
  };
}

export function fakeIdentification(
  convergence: { iteration: number; cost: number }[],
): IdentificationResult {
  const time_s = Array.from({ length: 240 }, (_, i) => i * 2);
  const line = (pick: (t: number) => number) => time_s.map(pick);
  const parameter = (
    name: string,
    title: string,
    before: number,
    after: number,
    spread: number,
    verdict: 'identified' | 'weak' | 'not identifiable' | 'fixed',
    reason = '',
  ) => ({
    name,
    title,
    unit: '',
    before,
    after,
    low: verdict === 'not identifiable' ? null : after - spread,
    high: verdict === 'not identifiable' ? null : after + spread,
    std: spread / 2,
    verdict,
    reason,
  });
  return {
    method: 'swarm',
    cost_before: convergence[0]?.cost ?? 1,
    cost_after: convergence.at(-1)?.cost ?? 0.1,
    convergence,
    parameters: [
      parameter('mass_1', 'Mass along the hull m1', 15.01, 14.72, 0.3, 'identified'),
      parameter('drag_0', 'Drag at no angle C_D0', 7.4, 7.11, 0.14, 'identified'),
      parameter('lift_alpha', 'Lift by angle of attack', 34.2, 36.8, 0.9, 'identified'),
      parameter(
        'yaw_tail',
        'Yaw moment of the tail',
        0.31,
        0.27,
        0.08,
        'weak',
        'The tail moved in 2 of 6 dives only.',
      ),
      parameter(
        'weight_height',
        'Height of the weight',
        0.005,
        0.005,
        0,
        'not identifiable',
        'Only its product with the weight enters the motion.',
      ),
      parameter('gravity', 'Gravity', 9.81, 9.81, 0, 'fixed'),
    ],
    fit: {
      time_s,
      measured: {
        depth_m: line((t) => 0.3 - 0.3 * Math.cos(t / 38) + 0.008 * Math.sin(t * 3)),
        pitch_rad: line((t) => 0.55 * Math.sin(t / 38) + 0.02 * Math.sin(t * 5)),
        heading_rad: line((t) => 0.5 + t / 900),
      },
      before: {
        depth_m: line((t) => 0.3 - 0.3 * Math.cos(t / 35)),
        pitch_rad: line((t) => 0.62 * Math.sin(t / 35)),
        heading_rad: line((t) => 0.5 + t / 1300),
      },
      after: {
        depth_m: line((t) => 0.3 - 0.3 * Math.cos(t / 37.8)),
        pitch_rad: line((t) => 0.55 * Math.sin(t / 37.8)),
        heading_rad: line((t) => 0.5 + t / 910),
      },
    },
    segments: [],
    left_out: [
      { kind: 'gap', start_s: 122, end_s: 134, message: 'no sample arrived' },
      { kind: 'surface', start_s: 240, end_s: 262, message: 'the robot was at the surface' },
    ],
  };
}
