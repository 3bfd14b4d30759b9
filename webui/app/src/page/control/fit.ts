import type { CostPoint, Values } from '../../api/types';
import type { Line } from '../../chart/line_chart';
import { withGaps, type Series } from '../../chart/series';
import { screenUnit } from '../../text/unit';
import { words } from '../../text/word';

type Column = (number | null)[];

interface Channel {
  title: string;
  unit: string;
  displayUnit: string | null;
  decimals: number;
  isDownwards?: boolean;
}

const CHANNELS: Record<string, Channel> = {
  depth_m: { title: 'Depth', unit: 'm', displayUnit: null, decimals: 2, isDownwards: true },
  pitch_rad: { title: 'Pitch', unit: 'rad', displayUnit: 'deg', decimals: 1 },
  roll_rad: { title: 'Roll', unit: 'rad', displayUnit: 'deg', decimals: 1 },
  heading_rad: { title: 'Heading', unit: 'rad', displayUnit: 'deg', decimals: 0 },
  north_m: { title: 'North', unit: 'm', displayUnit: null, decimals: 2 },
  east_m: { title: 'East', unit: 'm', displayUnit: null, decimals: 2 },
};

export interface FitPlot {
  key: string;
  title: string;
  isDownwards: boolean;
  lines: Line[];
  data: [number[], ...Column[]];
}

type Channels = Readonly<Record<string, Values>>;

interface Fit {
  time_s: readonly number[];
  measured: Channels;
  before: Channels | null;
  after: Channels;
}

/** One plot a channel: measured solid, predicted dashed, before and after. */
export function fitPlots(fit: Fit): FitPlot[] {
  return Object.keys(fit.measured).map((key) => {
    const channel = CHANNELS[key] ?? {
      title: words(key),
      unit: '',
      displayUnit: null,
      decimals: 2,
    };
    const { factor, label } = screenUnit(channel.unit, channel.displayUnit);
    const column = (values: readonly (number | null)[] | undefined): Series =>
      withGaps({
        t: [...fit.time_s],
        v: fit.time_s.map((_, i) => {
          const value = values?.[i] ?? null;
          return value === null ? null : value * factor;
        }),
      });
    const columns = [fit.measured[key], fit.before?.[key], fit.after[key]].map(column);
    const line = (name: string, colour: string, dash?: readonly number[]): Line => ({
      label: name,
      unit: label,
      colour,
      decimals: channel.decimals,
      ...(dash ? { dash } : {}),
    });
    return {
      key,
      title: channel.title,
      isDownwards: channel.isDownwards ?? false,
      lines: [
        line('measured', '--text'),
        line('predicted before', '--muted', [2, 4]),
        line('predicted after', '--accent', [8, 4]),
      ],
      data: [columns[0]?.t ?? [], ...columns.map(({ v }) => v)],
    };
  });
}

/** Columns of a convergence; a cost of 0 has no place on a scale of tenfold steps. */
export function costColumns(curve: readonly CostPoint[]): [number[], Column] {
  const sorted = curve.toSorted((a, b) => a.iteration - b.iteration);
  return [
    sorted.map(({ iteration }) => iteration),
    sorted.map(({ cost }) => (cost > 0 ? cost : null)),
  ];
}
