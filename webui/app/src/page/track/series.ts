import type { NorthEast, TargetReport } from '../../api/types';
import { ellipse95 } from '../../chart/ellipse';

/** Columns of every chart of the page, over one common time. */
export interface TrackColumns {
  /** s since 1970. */
  t: number[];
  inverseCondition: (number | null)[];
  determinant: (number | null)[];
  error: (number | null)[];
  known: (number | null)[];
  range: (number | null)[];
  distance: (number | null)[];
  wantedTurn: (number | null)[];
  doneTurn: (number | null)[];
  wantedAcceleration: (number | null)[];
  doneAcceleration: (number | null)[];
}

const DEGREES = 180 / Math.PI;
/** A range older than this many steps between reports was heard before, and is drawn once. */
const FRESH_STEPS = 1.5;

/** Reports as columns; where nothing was heard or known there is a gap. */
export function trackColumns(reports: readonly TargetReport[]): TrackColumns {
  const columns: TrackColumns = {
    t: [], inverseCondition: [], determinant: [], error: [], known: [], range: [], distance: [],
    wantedTurn: [], doneTurn: [], wantedAcceleration: [], doneAcceleration: [],
  }; // prettier-ignore
  const step = middleStep(reports);
  let before: TargetReport | null = null;
  for (const report of reports) {
    const t = Date.parse(report.measured_at) / 1000;
    if (before && t - Date.parse(before.measured_at) / 1000 > step * 6) {
      push(columns, t - step, null, step);
    }
    push(columns, t, report, step);
    before = report;
  }
  return columns;
}

function push(columns: TrackColumns, t: number, report: TargetReport | null, step: number): void {
  const likeliest = report?.hypotheses[0];
  /** Without an estimate its observability means nothing. */
  const known = likeliest ? report : null;
  const isFresh = report !== null && report.range_age_s <= step * FRESH_STEPS + 1;
  columns.t.push(t);
  columns.inverseCondition.push(known?.inverse_condition ?? null);
  columns.determinant.push(known ? Math.abs(known.determinant_m2_s) : null);
  columns.error.push(report?.error_m ?? null);
  columns.known.push(likeliest ? (ellipse95(likeliest.covariance_m2)?.longM ?? null) : null);
  columns.range.push(isFresh ? report.range_m : null);
  columns.distance.push(report ? distanceOf(report) : null);
  columns.wantedTurn.push(report ? report.nominal[0] * DEGREES : null);
  columns.doneTurn.push(report ? report.command[0] * DEGREES : null);
  columns.wantedAcceleration.push(report ? report.nominal[1] * 1000 : null);
  columns.doneAcceleration.push(report ? report.command[1] * 1000 : null);
}

/** Distance from the robot to the likeliest estimate, m. */
export function distanceOf(report: TargetReport): number | null {
  const target = report.hypotheses[0]?.position_ne_m;
  if (!target) return null;
  return Math.hypot(target[0] - report.position_ne_m[0], target[1] - report.position_ne_m[1]);
}

/** Middle of the times between reports, s. */
export function middleStep(reports: readonly Pick<TargetReport, 'measured_at'>[]): number {
  const times = reports.map(({ measured_at }) => Date.parse(measured_at) / 1000);
  const steps = times.slice(1).map((t, i) => t - (times[i] ?? t));
  return steps.toSorted((a, b) => a - b)[Math.floor(steps.length / 2)] ?? 1;
}

/** Where the robot was when it heard the newest range: nearest in time of what it said. */
export function rangeOrigin(reports: readonly TargetReport[], shown: TargetReport): NorthEast {
  const heardAt = Date.parse(shown.measured_at) - shown.range_age_s * 1000;
  let best = shown;
  let least = shown.range_age_s * 1000;
  for (const report of reports) {
    const off = Math.abs(Date.parse(report.measured_at) - heardAt);
    if (off < least) [best, least] = [report, off];
  }
  return best.position_ne_m;
}
