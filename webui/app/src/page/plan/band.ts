import type { FlightBand } from '../../api/types';
import type { PlacedEllipse } from '../../chart/ellipse';

/** Columns of a row along the legs: the mean place, and the ellipse about it. */
const NORTH = 9;
const EAST = 10;
const LONG = 11;
const SHORT = 12;
const DIRECTION = 13;
/** Columns of a row along time: the low one of three. */
export const LOW = { depth: 7, charge: 10 } as const;

/** Ellipses along the legs, which hold the flights that came so far. */
export function bandEllipses(band: FlightBand | null | undefined): PlacedEllipse[] {
  return (band?.along ?? []).map((row) => ({
    north: row[NORTH],
    east: row[EAST],
    longM: row[LONG],
    shortM: row[SHORT],
    directionRad: row[DIRECTION],
  }));
}

/** A band along time in a picture one unit wide and high: the area, and the median's line. */
export interface BandPicture {
  area: string;
  middle: string;
  least: number;
  most: number;
}

/** Draw three columns of the rows along time; `null` where there is nothing to draw. */
export function bandPicture(
  rows: FlightBand['over_time'],
  low: number,
  isDown: boolean,
): BandPicture | null {
  const end = rows.at(-1)?.[0] ?? 0;
  if (rows.length < 2 || end <= 0) return null;
  const column = (k: number) => rows.map((row) => row[low + k] ?? 0);
  const [lows, middles, highs] = [column(0), column(1), column(2)];
  const least = Math.min(...lows);
  const most = Math.max(...highs);
  const span = Math.max(most - least, 1e-9);
  const at = (values: number[], i: number) => {
    const share = ((values[i] ?? 0) - least) / span;
    return `${((rows[i]?.[0] ?? 0) / end).toFixed(4)} ${(isDown ? share : 1 - share).toFixed(4)}`;
  };
  const line = (values: number[]) => rows.map((_, i) => at(values, i));
  const area = [...line(highs), ...line(lows).reverse()];
  return { area: `M${area.join('L')}Z`, middle: `M${line(middles).join('L')}`, least, most };
}

/** What may happen, and how likely that is; what never did is told in one word. */
export interface Chance {
  what: string;
  share: number;
}

export function chances(band: FlightBand): Chance[] {
  return [
    { what: 'Not back as planned', share: band.not_back },
    { what: 'Leaves the water', share: band.leaves_water },
    ...band.touches.map((each) => ({ what: `In ${each.name}`, share: each.share })),
    { what: 'A dive cut short', share: band.dives_cut },
  ];
}

/** A share in words: of finitely many flights none is never. */
export function likely(share: number, flights: number): string {
  if (share <= 0) return flights > 0 ? `below ${percent(1 / flights)}` : '–';
  return percent(share);
}

function percent(share: number): string {
  const value = 100 * share;
  return `${value < 10 ? Number(value.toFixed(1)) : Math.round(value)} %`;
}
