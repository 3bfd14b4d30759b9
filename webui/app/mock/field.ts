import type { ComparedModel, FieldMap, Scores, Site } from '../src/api/types';
import type { FakeRobot } from './robot';
import { iso } from './robot';

export const TITLES: Record<string, string> = {
  position_noise: 'Position-dependent noise',
  joint: 'Joint auto-regressive',
  recursive: 'Recursive, by position uncertainty',
  single: 'Single, positions taken for exact',
};

/** The default first. */
export const MODELS = Object.keys(TITLES);

const FIGURES: Record<string, [rmse: number, nlpd: number, wmse: number, coverage: number]> = {
  position_noise: [0.158, -0.54, 0.91, 0.89],
  joint: [0.177, -0.24, 0.46, 0.96],
  recursive: [0.243, 1.45, 0.12, 1.0],
  single: [0.177, 0.04, 1.79, 0.74],
};

export const SCORES: Scores[] = MODELS.map((model) => {
  const [rmse = 0, nlpd = 0, wmse = 0, coverage_90 = 0] = FIGURES[model] ?? [];
  return { model, title: TITLES[model] ?? '', rmse, nlpd, wmse, coverage_90, samples: 1104 };
});

export const COMPARED: ComparedModel[] = SCORES.map(({ coverage_90, ...score }, i) => ({
  ...score,
  coverage: coverage_90,
  is_default: i === 0,
  log_marginal_likelihood: 812.4 - 140 * i,
}));

/** How much surer than the default a model claims to be. */
const SURENESS: Record<string, number> = { joint: 0.9, recursive: 0.55, single: 1.7 };

export function fakeMap(robot: FakeRobot, model: string, nowMs: number): FieldMap {
  const { domain, variable } = robot.site;
  const axis = (low: number, high: number, n: number) =>
    Array.from({ length: n }, (_, i) => low + ((high - low) * i) / (n - 1));
  const x = axis(domain.x_min_m, domain.x_max_m, 25);
  const y = axis(domain.y_min_m, domain.y_max_m, 25);
  const z = axis(0, domain.depth_max_m, 13);
  const mean: (number | null)[] = [];
  const std: (number | null)[] = [];
  const mask: boolean[] = [];
  const isLog = variable === 'blue_light';
  for (const [i] of x.entries()) {
    for (const [j] of y.entries()) {
      for (const [k] of z.entries()) {
        const [u, v, w] = [i / 24, j / 24, k / 12];
        const isWater = isInWater(robot.site, x[i] ?? 0, y[j] ?? 0, z[k] ?? 0);
        mask.push(isWater);
        if (!isWater) {
          mean.push(null);
          std.push(null);
          continue;
        }
        const bump = Math.exp(-((u - 0.62) ** 2 + (v - 0.4) ** 2) / 0.08 - (w - 0.4) ** 2 / 0.2);
        mean.push(isLog ? 6.2 - 2.1 * w + 0.9 * bump : 1.2 + 4 * bump + 0.5 * Math.sin(5 * v));
        const path = Math.abs(Math.sin(5 * u + 2.2 * v) - (2 * v - 1)) + 0.25 * Math.abs(w - 0.5);
        std.push((0.08 + 0.42 * (1 - Math.exp(-path * 1.6))) / (SURENESS[model] ?? 1));
      }
    }
  }
  return {
    robot: robot.id,
    variable,
    title: isLog ? 'Blue light' : 'Chlorophyll',
    unit: isLog ? 'counts' : 'ug/L',
    scale: isLog ? 'log' : 'linear',
    model,
    axes: { x_m: x, y_m: y, z_m: z },
    mean,
    std,
    mask: mask.every(Boolean) ? null : mask,
    samples: { total: 1104, per_fidelity: model === 'single' ? [1104] : [312, 405, 387] },
    smoothed_samples: 640,
    models: MODELS,
    updated_at: iso(nowMs - 2200),
    scores: null,
  };
}

/** Inside the shoreline and above the floor. */
export function isInWater(site: Site, north: number, east: number, depth: number): boolean {
  const corners = site.shoreline?.corners_m;
  if (!corners) return true;
  const [a, b] = [250, 250];
  const away = Math.hypot(north - a, (east - b) * 1.1);
  const crossings = corners.filter(([n1, e1], i) => {
    const [n0, e0] = corners.at(i - 1) ?? [0, 0];
    return e0 > east !== e1 > east && north < ((n1 - n0) * (east - e0)) / (e1 - e0) + n0;
  });
  return crossings.length % 2 === 1 && depth <= 20 - 15 * (away / 260) ** 2;
}
