import type uPlot from 'uplot';
import { clockDate, clockTime } from '../text/time';
import { plainNumber } from '../text/unit';
import { FLAG_MARKS, type FlagMark } from './flag_mark';
import { aloneAt } from './series';

/** One line of a chart. */
export interface Line {
  label: string;
  unit: string;
  /** Name of the colour token, such as `--accent`. */
  colour: string;
  /** Computed, not measured: dashed and lighter. */
  isPredicted?: boolean;
  /** Fill between the line and this value. */
  fillTo?: number;
  width?: number;
  decimals?: number;
  /** Lengths of dashes and gaps, px; told apart without colour. */
  dash?: readonly number[];
  /** Edge of a band: not drawn and not named by itself. */
  isEdge?: boolean;
  /** Values that are marked by a shape, with no line between them. */
  mark?: FlagMark;
}

/** A filled band between two columns of the data. */
export interface ChartBand {
  high: number;
  low: number;
  colour: string;
}

export interface ChartWish {
  lines: readonly Line[];
  /** Greater values further down, as depth is read. */
  isDownwards?: boolean;
  /** Station time (s since 1970) or plain seconds across. */
  across: 'time' | 'seconds' | 'count';
  bands?: readonly ChartBand[] | undefined;
  /** Every tenfold as high as the one before. */
  isLog?: boolean | undefined;
  /** Value that the vertical axis always includes. */
  includes?: readonly number[];
  sync?: string | undefined;
  onzoom?: ((from: number, to: number) => void) | undefined;
  /** Value across at which a line stands from top to bottom, asked for with each drawing. */
  mark?: () => number | null;
  /** Called with the value across at which somebody clicked. */
  onpick?: ((at: number) => void) | undefined;
}

/** The colours of the moment, read from the theme's tokens. */
export interface Palette {
  (token: string): string;
}

export function paletteOf(element: Element): Palette {
  const style = getComputedStyle(element);
  return (token) => style.getPropertyValue(token).trim();
}

/** Options of the drawing library for what a page wishes. */
export function chartOptions(
  wish: ChartWish,
  palette: Palette,
  width: number,
  height: number,
): uPlot.Options {
  const unit = wish.lines[0]?.unit ?? '';
  const axis = {
    stroke: palette('--muted'),
    font: '11px Inter, system-ui, sans-serif',
    grid: { stroke: palette('--line'), width: 1 },
    ticks: { show: false },
  };
  return {
    width,
    height,
    padding: [10, 30, 0, 0],
    legend: { show: false },
    cursor: {
      ...(wish.sync === undefined ? {} : { sync: { key: wish.sync } }),
      points: { size: 6 },
      drag: { x: true, y: false, setScale: wish.onzoom === undefined },
    },
    select: { show: true, left: 0, top: 0, width: 0, height: 0 },
    scales: {
      x: { time: false },
      y: wish.isLog
        ? TENFOLD
        : {
            dir: wish.isDownwards ? -1 : 1,
            range: (_chart, low, high) => padded(low, high, wish.includes ?? []),
          },
    },
    bands: (wish.bands ?? []).map(({ high, low, colour }) => ({
      series: [high, low] as uPlot.Band.Bounds,
      fill: `${palette(colour)}26`,
    })),
    axes: [
      {
        ...axis,
        size: 26,
        space: 76,
        values: (_chart, values) => values.map((value) => acrossTick(wish.across, value, values)),
        incrs: STEPS[wish.across],
      },
      {
        ...axis,
        size: 52,
        space: 28,
        values: (_chart, values) =>
          values.map((value: number | null) =>
            value === null ? '' : plainNumber(value).replace('-', '\u2212'),
          ),
        label: unit,
        labelSize: 16,
        labelFont: axis.font,
        labelGap: 0,
      },
    ],
    series: [{}, ...wish.lines.map((line) => lineOptions(line, palette))],
    hooks: {
      setSelect: wish.onzoom ? [zoomer(wish.onzoom)] : [],
      ready: wish.onpick ? [picker(wish.onpick)] : [],
      draw: [
        ...wish.lines.flatMap(({ mark }, i) =>
          mark === undefined ? [] : [shapes(mark, i + 1, palette)],
        ),
        ...(wish.mark === undefined ? [] : [marker(wish.mark, palette('--accent'))]),
      ],
    },
  };
}

/** A click that did not drag picks the value across. */
function picker(onpick: (at: number) => void): (chart: uPlot) => void {
  return (chart) => {
    let downX = NaN;
    chart.over.addEventListener('mousedown', ({ clientX }) => (downX = clientX));
    chart.over.addEventListener('click', ({ clientX }) => {
      if (Math.abs(clientX - downX) > CLICK_PX) return;
      onpick(chart.posToVal(clientX - chart.over.getBoundingClientRect().left, 'x'));
    });
  };
}

/** Draws a line from top to bottom at a value across. */
function marker(mark: () => number | null, colour: string): (chart: uPlot) => void {
  return (chart) => {
    const { ctx, bbox } = chart;
    const { min, max } = chart.scales.x ?? {};
    const at = mark();
    if (at === null || typeof min !== 'number' || typeof max !== 'number') return;
    if (at < min || at > max) return;
    const x = Math.round(chart.valToPos(at, 'x', true));
    ctx.save();
    ctx.strokeStyle = colour;
    ctx.lineWidth = Math.max(1, devicePixelRatio);
    ctx.beginPath();
    ctx.moveTo(x, bbox.top);
    ctx.lineTo(x, bbox.top + bbox.height);
    ctx.stroke();
    ctx.restore();
  };
}

/** Draws the shape of a mark at every value of a column. */
function shapes(mark: FlagMark, column: number, palette: Palette): (chart: uPlot) => void {
  const { d, colour, isFilled } = FLAG_MARKS[mark];
  return (chart) => {
    const { ctx, bbox, data } = chart;
    const shape = new Path2D(d);
    ctx.save();
    ctx.beginPath();
    ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
    ctx.clip();
    ctx.fillStyle = palette(colour);
    ctx.strokeStyle = palette(colour);
    ctx.lineWidth = 1.5;
    data[column]?.forEach((value, i) => {
      const at = data[0][i];
      if (typeof value !== 'number' || at === undefined) return;
      ctx.save();
      ctx.translate(chart.valToPos(at, 'x', true), chart.valToPos(value, 'y', true));
      ctx.scale(devicePixelRatio, devicePixelRatio);
      if (isFilled) ctx.fill(shape);
      else ctx.stroke(shape);
      ctx.restore();
    });
    ctx.restore();
  };
}

/** A pointer that moved farther than this dragged. */
const CLICK_PX = 3;

/** Scale of equal factors; the library's enum for it exists for the type checker only. */
const TENFOLD = { distr: 3, log: 10 } as unknown as uPlot.Scale;

function acrossTick(across: ChartWish['across'], value: number, values: readonly number[]): string {
  if (across === 'time') return timeTick(value, values);
  return across === 'seconds' ? `${value} s` : plainNumber(value);
}

const DAY_S = 86_400;
const TIME_STEPS = [
  1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 900, 1800, 3600, 7200, 14400, 43200, 86400, 172800,
  604800, 1209600, 2592000,
];
const PLAIN_STEPS = [0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000];

const STEPS = {
  time: TIME_STEPS,
  seconds: PLAIN_STEPS,
  count: PLAIN_STEPS.filter((step) => step >= 1),
};

/** As fine as the steps between ticks: seconds, minutes or days. */
function timeTick(value: number, values: readonly number[]): string {
  const [first = 0, second = 0] = values;
  const step = second - first;
  return step >= DAY_S ? clockDate(value * 1000) : clockTime(value * 1000, step < 60);
}

function lineOptions(line: Line, palette: Palette): uPlot.Series {
  if (line.isEdge || line.mark) return { label: line.label, width: 0, points: { show: false } };
  const stroke = palette(line.isPredicted ? '--predicted' : line.colour);
  const dash = line.dash ?? (line.isPredicted ? [6, 5] : null);
  return {
    label: line.label,
    stroke,
    width: line.width ?? 1.5,
    points: line.isPredicted ? { show: false } : dots(stroke),
    spanGaps: line.isPredicted ?? false,
    ...(dash === null ? {} : { dash: [...dash] }),
    ...(line.fillTo === undefined ? {} : { fill: `${stroke}1f`, fillTo: line.fillTo }),
  };
}

/** A dot for every value that no line leads to, which would not be seen at all. */
function dots(colour: string): uPlot.Series.Points {
  return {
    show: false,
    size: 5,
    fill: colour,
    filter: (chart, series) => {
      const alone = aloneAt(chart.data[series] ?? []);
      return alone.length > 0 ? alone : null;
    },
  };
}

/** Bounds with a little room, including the values that must be seen. */
export function padded(
  low: number | null,
  high: number | null,
  includes: readonly number[],
): [number, number] {
  const values = [low, high].filter((value) => value !== null && Number.isFinite(value));
  const all = [...(values as number[]), ...includes];
  if (all.length === 0) return [0, 1];
  const least = Math.min(...all);
  const most = Math.max(...all);
  const room = (most - least || Math.abs(most) || 1) * 0.06;
  const isEdge = (value: number) => includes.includes(value);
  return [isEdge(least) ? least - room * 0.3 : least - room, most + room];
}

function zoomer(onzoom: (from: number, to: number) => void): (chart: uPlot) => void {
  return (chart) => {
    const { left, width } = chart.select;
    if (width < 4) return;
    onzoom(chart.posToVal(left, 'x'), chart.posToVal(left + width, 'x'));
    chart.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
  };
}
