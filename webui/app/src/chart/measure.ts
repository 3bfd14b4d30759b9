/** Distances and bearings along geodesics of the WGS84 ellipsoid. */
import type { NorthEast } from '../api/types';
import { northEast, wgs84, type Origin } from '../text/frame';
import { compact, fixed } from '../text/unit';

export interface Geodesic {
  metres: number;
  /** From true north, where it begins. */
  bearingDeg: number;
}

/** The way from one place of a site to another. */
export function geodesic(site: Origin, from: NorthEast, to: NorthEast): Geodesic {
  const start = wgs84(site, from[0], from[1]);
  const end = wgs84(site, to[0], to[1]);
  const origin = { origin_latitude_deg: start.latitude, origin_longitude_deg: start.longitude };
  const [north, east] = northEast(origin, end.latitude, end.longitude);
  return {
    metres: Math.hypot(north, east),
    bearingDeg: ((Math.atan2(east, north) * 180) / Math.PI + 360) % 360,
  };
}

export function distanceText(metres: number): string {
  if (metres >= 10_000) return `${fixed(metres / 1000, 2)} km`;
  if (metres >= 1000) return `${fixed(metres / 1000, 3)} km`;
  return metres >= 100 ? `${fixed(metres, 1)} m` : `${compact(metres)} m`;
}

/** Three digits before the point, as bearings are spoken. */
export function bearingText(degrees: number): string {
  const tenths = Math.round(degrees * 10) % 3600;
  return `${(tenths / 10).toFixed(1).padStart(5, '0')}°`;
}

export function wayText({ metres, bearingDeg }: Geodesic): string {
  return `${distanceText(metres)}, ${bearingText(bearingDeg)}`;
}

/** One stretch of a way that is measured. */
export interface Way extends Geodesic {
  from: NorthEast;
  to: NorthEast;
}
