import type { Site } from '../api/types';

const EQUATOR_M = 6_378_137;
const ECCENTRICITY_SQUARED = 6.69437999014e-3;

/** Latitude and longitude, degrees, of a point near a site's origin (tangent plane, WGS84). */
export function wgs84(
  site: Pick<Site, 'origin_latitude_deg' | 'origin_longitude_deg'>,
  northM: number,
  eastM: number,
): { latitude: number; longitude: number } {
  const origin = (site.origin_latitude_deg * Math.PI) / 180;
  const w = Math.sqrt(1 - ECCENTRICITY_SQUARED * Math.sin(origin) ** 2);
  const meridian = (EQUATOR_M * (1 - ECCENTRICITY_SQUARED)) / w ** 3;
  const normal = EQUATOR_M / w;
  return {
    latitude: site.origin_latitude_deg + ((northM / meridian) * 180) / Math.PI,
    longitude: site.origin_longitude_deg + ((eastM / (normal * Math.cos(origin))) * 180) / Math.PI,
  };
}
