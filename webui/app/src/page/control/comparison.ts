import type { Comparison, ComparisonRun, ComparisonSummary } from '../../api/types';
import type { ChartBand, Line } from '../../chart/line_chart';
import { compact, fixed, screenUnit } from '../../text/unit';

type Values = readonly (number | null)[];
type Column = (number | null)[];

/** Most controllers in one run; as many colours and dashes are told apart. */
export const MOST_RUNS = 6;

/** Dashes of the runs, so that they are told apart without colour and look computed. */
const DASHES: readonly (readonly number[])[] = [
  [9, 3],
  [3, 3],
  [9, 3, 2, 3],
  [14, 4],
  [6, 2, 2, 2, 2, 2],
  [2, 5],
];

export function runColour(place: number): string {
  return `--run-${place % MOST_RUNS}`;
}

export function runDash(place: number): readonly number[] {
  return DASHES[place % MOST_RUNS] ?? [];
}

/** One plot of a comparison. */
export interface ComparisonPlot {
  key: string;
  title: string;
  help: string;
  unit: string;
  displayUnit: string | null;
  decimals: number;
  values: (run: ComparisonRun) => Values;
  band?: (run: ComparisonRun) => { low: Values; high: Values } | undefined;
}

export const ERROR_PLOTS: readonly ComparisonPlot[] = [
  {
    key: 'depth',
    title: 'Depth error',
    help: 'How far above or below the reference.',
    unit: 'm',
    displayUnit: null,
    decimals: 3,
    values: ({ errors }) => errors.depth_m,
    band: ({ band }) => band.depth_m,
  },
  {
    key: 'horizontal',
    title: 'Horizontal error',
    help: 'Distance from the reference, seen from above.',
    unit: 'm',
    displayUnit: null,
    decimals: 3,
    values: ({ errors }) => errors.horizontal_m,
    band: ({ band }) => band.horizontal_m,
  },
  {
    key: 'pitch',
    title: 'Pitch error',
    help: 'Pitch of the hull against that of the reference.',
    unit: 'rad',
    displayUnit: 'deg',
    decimals: 2,
    values: ({ errors }) => errors.pitch_rad,
    band: ({ band }) => band.pitch_rad,
  },
];

export const INPUT_PLOTS: readonly ComparisonPlot[] = [
  {
    key: 'm0',
    title: 'Net buoyancy m₀',
    help: 'What the buoyancy pump does; positive sinks.',
    unit: 'kg',
    displayUnit: 'g',
    decimals: 1,
    values: ({ inputs }) => inputs.m0_kg,
  },
  {
    key: 'rp1',
    title: 'Mass position rₚ₁',
    help: 'Where the movable mass is; forward is positive.',
    unit: 'm',
    displayUnit: 'mm',
    decimals: 1,
    values: ({ inputs }) => inputs.rp1_m,
  },
  {
    key: 'delta',
    title: 'Tail angle δ',
    help: 'Angle of the tail.',
    unit: 'rad',
    displayUnit: 'deg',
    decimals: 1,
    values: ({ inputs }) => inputs.delta_rad,
  },
];

export interface DrawnPlot {
  lines: Line[];
  data: [number[], ...Column[]];
  bands: ChartBand[];
}

/** Columns of a plot: a line a run, then the edges of the bands, which are filled between. */
export function drawnPlot(comparison: Comparison, plot: ComparisonPlot): DrawnPlot {
  const { factor, label } = screenUnit(plot.unit, plot.displayUnit);
  const lines: Line[] = comparison.runs.map((run, i) => ({
    label: run.title,
    unit: label,
    colour: runColour(i),
    dash: runDash(i),
    decimals: plot.decimals,
  }));
  const columns: Column[] = comparison.runs.map((run) => scaled(plot.values(run), factor));
  const bands: ChartBand[] = [];
  comparison.runs.forEach((run, i) => {
    const band = plot.band?.(run);
    if (!band || comparison.seeds.length < 2) return;
    bands.push({ high: lines.length + 1, low: lines.length + 2, colour: runColour(i) });
    for (const edge of ['high', 'low'] as const) {
      lines.push({
        label: `${run.title}, ${edge}`,
        unit: label,
        colour: runColour(i),
        isEdge: true,
      });
      columns.push(scaled(band[edge], factor));
    }
  });
  return { lines, data: [comparison.time_s.map((at) => at ?? NaN), ...columns], bands };
}

function scaled(values: Values, factor: number): Column {
  return values.map((value) => (value === null ? null : value * factor));
}

/** One row of the summary: a value a run, the least the best. */
export interface SummaryRow {
  title: string;
  unit: string;
  help: string;
  texts: string[];
  /** Places of the runs that share the best value; nothing is best among one or none. */
  best: number[];
}

interface Metric {
  title: string;
  help: string;
  unit: string;
  displayUnit: string | null;
  of: (summary: ComparisonSummary) => number | null;
}

const METRICS: readonly Metric[] = [
  metric(
    'Depth error, RMS',
    'm',
    'cm',
    'Root mean square over the whole run.',
    (s) => s.depth_rms_m,
  ),
  metric(
    'Horizontal error, RMS',
    'm',
    null,
    'Root mean square over the whole run, the way in included.',
    (s) => s.horizontal_rms_m,
  ),
  metric(
    'Horizontal error at the end',
    'm',
    null,
    'What is left when the run ends.',
    (s) => s.horizontal_end_m,
  ),
  metric('Pitch error, RMS', 'rad', 'deg', 'Root mean square.', (s) => s.pitch_rms_rad),
  metric(
    'Hybrid pitch error, RMS',
    'rad',
    'deg',
    'Pitch error with the horizontal error weighed in, for all controllers with the same weight.',
    (s) => s.hybrid_rms_rad,
  ),
  metric('Buoyancy pumped', 'kg', 'g', 'All moves of the pump added up.', (s) => s.travel.m0_kg),
  metric('Mass moved', 'm', 'cm', 'All moves of the mass added up.', (s) => s.travel.rp1_m),
  metric('Tail moved', 'rad', 'deg', 'All moves of the tail added up.', (s) => s.travel.delta_rad),
  metric(
    'Energy',
    'J',
    null,
    'Electrical energy with estimated prices of each actuator; good for comparing, not for absolute figures.',
    (s) => s.energy_j,
  ),
];

function metric(
  title: string,
  unit: string,
  displayUnit: string | null,
  help: string,
  of: Metric['of'],
): Metric {
  return { title, unit, displayUnit, help, of };
}

export function summaryRows(runs: readonly ComparisonRun[]): SummaryRow[] {
  return METRICS.map(({ title, unit, displayUnit, help, of }) => {
    const { factor, label } = screenUnit(unit, displayUnit);
    const values = runs.map(({ summary }) => {
      const value = of(summary);
      return value === null ? null : value * factor;
    });
    const texts = alike(values);
    return { title, unit: label, help, texts, best: bestOf(texts, values) };
  });
}

/** Values of one row with as many decimals as its largest needs for three digits. */
function alike(values: readonly (number | null)[]): string[] {
  const most = Math.max(0, ...values.map((value) => Math.abs(value ?? 0)));
  if (most === 0 || most >= 1e6 || most < 1e-4) return values.map((value) => compact(value));
  const decimals = Math.max(0, 2 - Math.floor(Math.log10(most)));
  return values.map((value) => (value === null ? '–' : fixed(value, decimals)));
}

/** What reads the same is equally good. */
function bestOf(texts: readonly string[], values: readonly (number | null)[]): number[] {
  const known = values.filter((value) => value !== null);
  if (known.length < 2) return [];
  const best = texts[values.indexOf(Math.min(...known))];
  const places = texts.flatMap((text, i) => (text === best ? [i] : []));
  return places.length === texts.length ? [] : places;
}
