/** Lines of a map's grid: of equal latitude and longitude, or of the site's own metres. */
import { northEast, wgs84, type Origin } from '../text/frame';
import { latitude, longitude, type PositionFormat } from '../text/position';
import { fixed } from '../text/unit';
import { ticks } from './slice';
import type { Reach } from './web_mercator';

export type GridKind = 'geographic' | 'metres' | 'none';

export interface GridLine {
  /** North and east along the line, m. */
  points: [north: number, east: number][];
  /** Where it meets the left edge of the sight as north, or the lower edge as east, m. */
  at: number;
  label: string;
}

export interface Grid {
  /** From the west to the east. */
  across: GridLine[];
  /** From the south to the north. */
  up: GridLine[];
}

const STEPS = [1, 2, 5, 10, 15, 20, 30, 60].flatMap((step) => step);
/** Degrees of the lines' distances that read well in each notation. */
const ROUND: Record<PositionFormat, readonly number[]> = {
  degrees: Array.from({ length: 8 }, (_, i) => [1, 2, 5].map((s) => s * 10 ** (i - 5))).flat(),
  minutes: [
    ...[0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, ...STEPS].map((s) => s / 60),
    ...[2, 5, 10, 20, 30],
  ],
  seconds: [
    ...[0.1, 0.2, 0.5, ...STEPS].map((s) => s / 3600),
    ...STEPS.slice(1).map((s) => s / 60),
    ...[2, 5, 10, 20, 30],
  ],
};
const LINES_MAX = 40;
/** Parts of a line that is curved in the site's frame. */
const PARTS = 12;

/** Whether lines of latitude and longitude can be told apart in the notation. */
export function hasGeographic(stepM: number, format: PositionFormat): boolean {
  return (ROUND[format][0] ?? 0) * 111_000 <= stepM;
}

/** Least of the round distances, deg, that is no shorter than a length on the ground. */
export function roundStep(degrees: number, format: PositionFormat): number {
  return ROUND[format].find((step) => step >= degrees * (1 - 1e-9)) ?? 45;
}

export function gridOf(
  site: Origin,
  reach: Reach,
  kind: GridKind,
  format: PositionFormat,
  /** Least distance between two lines, m, up and across: labels need their room. */
  room: { up: number; across: number },
): Grid {
  if (kind === 'none') return { across: [], up: [] };
  const isFine = kind === 'geographic' && hasGeographic(Math.max(room.up, room.across), format);
  return isFine ? geographic(site, reach, format, room) : metres(reach, room);
}

function metres(reach: Reach, room: { up: number; across: number }): Grid {
  const [south, north] = reach.north;
  const [west, east] = reach.east;
  const count = (low: number, high: number, least: number) =>
    Math.max(1, Math.min(LINES_MAX, Math.floor((high - low) / least)));
  const isFar = Math.max(north - south, east - west) >= 5000;
  const text = (m: number, step: number) => {
    const value = isFar ? m / 1000 : m;
    const digits = Math.max(0, Math.ceil(-Math.log10(isFar ? step / 1000 : step) - 1e-9));
    return `${fixed(value, digits)} ${isFar ? 'km' : 'm'}`;
  };
  const stepOf = (values: number[]) => (values[1] ?? 1) - (values[0] ?? 0);
  const norths = ticks(south, north, count(south, north, room.across));
  const easts = ticks(west, east, count(west, east, room.up));
  return {
    across: norths.map((at) => ({
      points: [
        [at, west],
        [at, east],
      ],
      at,
      label: `${text(at, stepOf(norths))} N`,
    })),
    up: easts.map((at) => ({
      points: [
        [south, at],
        [north, at],
      ],
      at,
      label: `${text(at, stepOf(easts))} E`,
    })),
  };
}

function geographic(
  site: Origin,
  reach: Reach,
  format: PositionFormat,
  room: { up: number; across: number },
): Grid {
  const corners = reach.north.flatMap((north) =>
    [reach.east[0], (reach.east[0] + reach.east[1]) / 2, reach.east[1]].map((east) =>
      wgs84(site, north, east),
    ),
  );
  const near = (degrees: number) =>
    degrees + 360 * Math.round((site.origin_longitude_deg - degrees) / 360);
  const latitudes = corners.map((place) => place.latitude);
  const longitudes = corners.map((place) => near(place.longitude));
  const range = (values: number[]): [number, number] => [Math.min(...values), Math.max(...values)];
  const [south, north] = range(latitudes);
  const [west, east] = range(longitudes);
  const perNorth = (north - south) / (reach.north[1] - reach.north[0]);
  const perEast = (east - west) / (reach.east[1] - reach.east[0]);
  const along = (low: number, high: number, place: (at: number) => [number, number]) =>
    Array.from({ length: PARTS + 1 }, (_, i) => place(low + ((high - low) * i) / PARTS));
  const across = multiples(south, north, roundStep(room.across * perNorth, format)).map((at) => {
    const points = along(west, east, (lon) => northEast(site, at, lon));
    return { points, at: crossing(points, reach.east[0], 1), label: latitude(at, format) };
  });
  const up = multiples(west, east, roundStep(room.up * perEast, format)).map((at) => {
    const points = along(south, north, (lat) => northEast(site, lat, at));
    const wrapped = at - 360 * Math.round(at / 360);
    return { points, at: crossing(points, reach.north[0], 0), label: longitude(wrapped, format) };
  });
  return { across, up };
}

function multiples(low: number, high: number, step: number): number[] {
  const first = Math.ceil(low / step);
  const last = Math.floor(high / step);
  if (last - first > LINES_MAX) return [];
  return Array.from({ length: Math.max(0, last - first + 1) }, (_, i) => (first + i) * step);
}

/** The other coordinate where a line passes a value of one: 0 north, 1 east. */
function crossing(points: readonly [number, number][], value: number, axis: 0 | 1): number {
  const other = axis === 0 ? 1 : 0;
  const sorted = points.toSorted((a, b) => a[axis] - b[axis]);
  const i = Math.max(
    0,
    Math.min(
      sorted.length - 2,
      sorted.findLastIndex((point) => point[axis] <= value),
    ),
  );
  const [from, to] = [sorted[i], sorted[i + 1]];
  if (!from || !to) return NaN;
  const share = (value - from[axis]) / (to[axis] - from[axis] || 1);
  return from[other] + share * (to[other] - from[other]);
}

/** A scale bar: the longest round length within a width. */
export function scaleBar(pixelsPerM: number, widthPx: number): { px: number; text: string } {
  const most = widthPx / pixelsPerM;
  const power = 10 ** Math.floor(Math.log10(most));
  const length = ([5, 2, 1].find((step) => step * power <= most) ?? 1) * power;
  const digits = (value: number) => Math.max(0, Math.ceil(-Math.log10(value) - 1e-9));
  const text =
    length >= 1000
      ? `${fixed(length / 1000, 0)} km`
      : length >= 1
        ? `${fixed(length, 0)} m`
        : length >= 0.01
          ? `${fixed(length * 100, 0)} cm`
          : `${fixed(length * 1000, digits(length * 1000))} mm`;
  return { px: length * pixelsPerM, text };
}
