import type { DiveFacts, Series } from '../../../api/types';
import type { Measure } from './drawing';

/** Figures in one line of Python, of the NetCDF file of a delivery. */

export interface Chosen {
  /** Name of the file. */
  file: string;
  /** Values with a greater flag are left out; 4 keeps all. */
  flagMax: number;
  /** First and last moment of the dives that are shown; all if `null`. */
  span: readonly [begin: string, end: string] | null;
}

const XARRAY = 'import xarray as xr; ';

/** The file without what is not shown. */
function opened({ file, flagMax, span }: Chosen, names: readonly string[]): string {
  const begin = `ds = xr.open_dataset(${JSON.stringify(file)})`;
  const kept = names
    .filter((name) => flagMax < 4 && !STATES.has(name))
    .map((name) => `(ds.${name}_QC <= ${flagMax})`);
  if (span)
    kept.push(...span.map((at, i) => `(ds.TIME ${i ? '<=' : '>='} np.datetime64("${at}"))`));
  const where = kept.length > 0 ? `; ds = ds.where(${kept.join(' & ')})` : '';
  return `${span ? 'import numpy as np; ' : ''}${begin}${where}; `;
}

/** Variables of a state, which are not judged. */
const STATES: ReadonlySet<string> = new Set([
  ...['PITCH', 'ROLL', 'HEADING', 'NET_BUOYANCY', 'MASS_POSITION', 'TAIL_ANGLE'],
  'BATTERY_VOLTAGE',
]);

export function sectionLine({ variable }: Series, chosen: Chosen): string {
  return (
    XARRAY +
    opened(chosen, [variable]) +
    `ds.plot.scatter(x="TIME", y="DEPTH", hue="${variable}").axes.invert_yaxis()`
  );
}

export function profilesLine({ variable }: Series, chosen: Chosen): string {
  return (
    XARRAY +
    opened(chosen, [variable]) +
    `ds.plot.scatter(x="${variable}", y="DEPTH", hue="PROFILE_NUMBER").axes.invert_yaxis()`
  );
}

/** @param isBetween Whether values lie between two that were measured. */
export function scatterLine(x: Series, y: Series, isBetween: boolean, chosen: Chosen): string {
  const names = [x.variable, y.variable];
  const aligned = isBetween
    ? '.swap_dims(N_MEASUREMENTS="TIME")' +
      `[${JSON.stringify([...new Set([...names, 'DEPTH'])])}]` +
      '.interpolate_na("TIME", max_gap="10s")'
    : '';
  return (
    XARRAY +
    opened(chosen, names) +
    `ds${aligned}.plot.scatter(x="${x.variable}", y="${y.variable}", hue="DEPTH")`
  );
}

export function tsLine(chosen: Chosen): string {
  return (
    `import gsw; ${XARRAY}` +
    opened(chosen, ['SA', 'TEMP']) +
    'ds.assign(CT=gsw.CT_from_t(ds.SA, ds.TEMP, gsw.p_from_z(-ds.DEPTH, ds.LATITUDE)))' +
    '.plot.scatter(x="SA", y="CT", hue="DEPTH")'
  );
}

export function histogramLine({ variable }: Series, chosen: Chosen): string {
  return `${XARRAY}${opened(chosen, [variable])}ds.${variable}.plot.hist(bins=40)`;
}

/** Of each half of a dive, as the file numbers them; empty where it does not tell the measure. */
export function divesLine(measure: Measure, chosen: Chosen): string {
  const begin = XARRAY + opened({ ...chosen, flagMax: 4, span: null }, []);
  if (measure === 'depth_m') return `${begin}ds.DEPTH.groupby(ds.PROFILE_NUMBER).max().plot()`;
  if (measure === 'duration_s') {
    return `${begin}t = ds.TIME.groupby(ds.PROFILE_NUMBER); (t.max() - t.min()).plot()`;
  }
  return '';
}

/** Whether the file holds everything that a line needs. */
export function isInFile(...series: readonly Series[]): boolean {
  return series.every(({ variable }) => variable !== '');
}

/** From when to when dives are that a text such as `1-5,9` names; `null` for all. */
export function spanOf(
  dives: readonly DiveFacts[],
  named: string,
): readonly [begin: string, end: string] | null {
  const spans = named
    .split(',')
    .map((part) => part.trim().split('-').map(Number))
    .map(([first = 0, last = first]) => [first, last] as const);
  const chosen = dives.filter(({ number }) => spans.some(([a, b]) => number >= a && number <= b));
  const [begin, end] = [chosen[0]?.begin_at, chosen.at(-1)?.end_at];
  if (!named.trim() || !begin || !end) return null;
  const plain = (at: string) => new Date(at).toISOString().replace('Z', '');
  return [plain(begin), plain(end)];
}
