/** Tiles of Web Mercator, and where each lies in a site's own frame. */
import { northEast, wgs84, type Origin } from '../text/frame';

const TILE_PX = 256;
/** Width of one pixel of zoom 0 at the equator, m. */
const PIXEL_M = (2 * Math.PI * 6_378_137) / TILE_PX;
const LATITUDE_MAX = 85.051_129;
const DEGREE = Math.PI / 180;
/** More tiles than this are never asked for at once. */
const TILES_MAX = 160;
/** Points along each edge of the sight that say how far it reaches. */
const EDGE_STEPS = 4;

/** What a base map covers. */
export interface Coverage {
  west_deg: number;
  south_deg: number;
  /** Less than the west edge where the map crosses the antimeridian. */
  east_deg: number;
  north_deg: number;
  min_zoom: number;
  max_zoom: number;
}

/** Part of a site's frame, m. */
export interface Reach {
  north: readonly [low: number, high: number];
  east: readonly [low: number, high: number];
}

export interface TilePlace {
  z: number;
  x: number;
  y: number;
}

/** Column, in tiles from the antimeridian; beyond the edges it counts on. */
export function columnOf(longitude: number, z: number): number {
  return ((longitude + 180) / 360) * 2 ** z;
}

/** Row, in tiles from the north. */
export function rowOf(latitude: number, z: number): number {
  const held = Math.max(-LATITUDE_MAX, Math.min(LATITUDE_MAX, latitude)) * DEGREE;
  return (0.5 - Math.asinh(Math.tan(held)) / (2 * Math.PI)) * 2 ** z;
}

export function latitudeOf(row: number, z: number): number {
  return Math.atan(Math.sinh(Math.PI * (1 - (2 * row) / 2 ** z))) / DEGREE;
}

export function longitudeOf(column: number, z: number): number {
  return (column / 2 ** z) * 360 - 180;
}

/** Zoom whose pixels are nearest to those of the screen, of what the map has. */
export function zoomFor(latitude: number, pixelsPerM: number, map: Coverage, density = 1): number {
  const wanted = Math.log2(PIXEL_M * Math.cos(latitude * DEGREE) * pixelsPerM * density);
  return Math.max(map.min_zoom, Math.min(map.max_zoom, Math.round(wanted)));
}

/** The edges of the sight in degrees; longitudes go on beyond 180 rather than jump. */
function edges(
  site: Origin,
  reach: Reach,
): [west: number, south: number, east: number, north: number] {
  const longitudes: number[] = [];
  const latitudes: number[] = [];
  for (let i = 0; i <= EDGE_STEPS; i++) {
    for (let j = 0; j <= EDGE_STEPS; j++) {
      const at = (ends: readonly [number, number], step: number) =>
        ends[0] + ((ends[1] - ends[0]) * step) / EDGE_STEPS;
      const place = wgs84(site, at(reach.north, i), at(reach.east, j));
      latitudes.push(place.latitude);
      longitudes.push(nearTo(place.longitude, site.origin_longitude_deg));
    }
  }
  return [
    Math.min(...longitudes),
    Math.min(...latitudes),
    Math.max(...longitudes),
    Math.max(...latitudes),
  ];
}

/** The same meridian, less than half a turn from another. */
function nearTo(longitude: number, other: number): number {
  return longitude + 360 * Math.round((other - longitude) / 360);
}

/** Tiles of one zoom that the sight shows; none where they would be too many. */
export function tilesIn(site: Origin, reach: Reach, map: Coverage, z: number): TilePlace[] {
  const [west, south, east, north] = edges(site, reach);
  const mapWest = nearTo(map.west_deg, (west + east) / 2);
  const width = map.east_deg - map.west_deg;
  const mapEast = mapWest + (width > 0 ? width : width + 360);
  const found: TilePlace[] = [];
  // A map that crosses the antimeridian may be met on either side of it.
  for (const turn of [-360, 0, 360]) {
    const x0 = Math.floor(columnOf(Math.max(west, mapWest + turn), z) + 1e-9);
    const x1 = Math.ceil(columnOf(Math.min(east, mapEast + turn), z) - 1e-9);
    const y0 = Math.floor(rowOf(Math.min(north, map.north_deg), z) + 1e-9);
    const y1 = Math.ceil(rowOf(Math.max(south, map.south_deg), z) - 1e-9);
    if (x1 <= x0 || y1 <= y0) continue;
    if ((x1 - x0) * (y1 - y0) > TILES_MAX) return [];
    for (let y = Math.max(0, y0); y < Math.min(2 ** z, y1); y++) {
      for (let x = x0; x < x1; x++) found.push({ z, x, y });
    }
  }
  return found;
}

/** Whether a map covers a part of a site. */
export function covers(site: Origin, reach: Reach, map: Coverage): boolean {
  return (
    tilesIn(site, reach, map, Math.min(map.max_zoom, 1)).length > 0 && isWithin(site, reach, map)
  );
}

function isWithin(site: Origin, reach: Reach, map: Coverage): boolean {
  const [west, south, east, north] = edges(site, reach);
  const mapWest = nearTo(map.west_deg, (west + east) / 2);
  const width = map.east_deg - map.west_deg;
  const mapEast = mapWest + (width > 0 ? width : width + 360);
  return (
    [-360, 0, 360].some((turn) => west < mapEast + turn && east > mapWest + turn) &&
    south < map.north_deg &&
    north > map.south_deg
  );
}

/** From pixels of a tile, x right and y down, to east and south of the site's frame, m. */
export interface Affine {
  /** East and south of one pixel to the right. */
  right: readonly [east: number, south: number];
  /** East and south of one pixel down. */
  down: readonly [east: number, south: number];
  /** East and south of the tile's upper left corner. */
  corner: readonly [east: number, south: number];
  /** How far a corner of the tile lies from where it should, m. */
  errorM: number;
}

/** How a tile lies in a site's frame, as nearly as one straight mapping can say. */
export function affineOf(site: Origin, { z, x, y }: TilePlace): Affine {
  const at = (dx: number, dy: number): [number, number] => {
    const [north, east] = northEast(site, latitudeOf(y + dy, z), longitudeOf(x + dx, z));
    return [east, -north];
  };
  const [nw, ne, sw, se] = [at(0, 0), at(1, 0), at(0, 1), at(1, 1)];
  const mix = (f: (axis: 0 | 1) => number): [number, number] => [f(0), f(1)];
  const right = mix((i) => (ne[i] - nw[i] + se[i] - sw[i]) / 2);
  const down = mix((i) => (sw[i] - nw[i] + se[i] - ne[i]) / 2);
  const middle = mix((i) => (nw[i] + ne[i] + sw[i] + se[i]) / 4);
  return {
    right: mix((i) => right[i] / TILE_PX),
    down: mix((i) => down[i] / TILE_PX),
    corner: mix((i) => middle[i] - right[i] / 2 - down[i] / 2),
    errorM: Math.hypot(...mix((i) => (nw[i] - ne[i] - sw[i] + se[i]) / 4)),
  };
}
