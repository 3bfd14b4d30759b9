import type { FieldMap, Scores } from '../src/api/types';
import type { FakeRobot } from './robot';
import { iso } from './robot';

export const SCORES: Scores[] = [
  {
    model: 'recursive',
    title: 'Three fidelities',
    rmse: 0.1312,
    nlpd: -0.412,
    wmse: 0.0207,
    coverage_90: 0.91,
    samples: 1104,
  },
  {
    model: 'single',
    title: 'One fidelity',
    rmse: 0.1874,
    nlpd: 0.038,
    wmse: 0.0391,
    coverage_90: 0.78,
    samples: 1104,
  },
];

export function fakeMap(robot: FakeRobot, model: string, nowMs: number): FieldMap {
  const { domain, variable } = robot.site;
  const axis = (low: number, high: number, n: number) =>
    Array.from({ length: n }, (_, i) => low + ((high - low) * i) / (n - 1));
  const x = axis(domain.x_min_m, domain.x_max_m, 25);
  const y = axis(domain.y_min_m, domain.y_max_m, 25);
  const z = axis(0, domain.depth_max_m, 13);
  const mean: number[] = [];
  const std: number[] = [];
  const isLog = variable === 'blue_light';
  for (const [i] of x.entries()) {
    for (const [j] of y.entries()) {
      for (const [k] of z.entries()) {
        const [u, v, w] = [i / 24, j / 24, k / 12];
        const bump = Math.exp(-((u - 0.62) ** 2 + (v - 0.4) ** 2) / 0.08 - (w - 0.4) ** 2 / 0.2);
        mean.push(isLog ? 6.2 - 2.1 * w + 0.9 * bump : 1.2 + 4 * bump + 0.5 * Math.sin(5 * v));
        const path = Math.abs(Math.sin(5 * u + 2.2 * v) - (2 * v - 1)) + 0.25 * Math.abs(w - 0.5);
        std.push(0.08 + (model === 'single' ? 0.3 : 0.42) * (1 - Math.exp(-path * 1.6)));
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
    samples: { total: 1104, per_fidelity: model === 'single' ? [1104] : [312, 405, 387] },
    updated_at: iso(nowMs - 2200),
    scores: null,
  };
}
