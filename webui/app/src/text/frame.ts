/**
 * A site's frame on the WGS84 ellipsoid: north and east are those of the geodesic that leads to a
 * place from the origin (T. Vincenty, Survey Review 23 (176), 1975), as in `autonomy/frames.py`.
 * Good within 1,000 km of the origin.
 */
import type { Site } from '../api/types';

export type Origin = Pick<Site, 'origin_latitude_deg' | 'origin_longitude_deg'>;
export interface Place {
  latitude: number;
  longitude: number;
}

const FLATTENING = 1 / 298.257_223_563;
const POLE_M = 6_378_137 * (1 - FLATTENING);
const SECOND_ECCENTRICITY_SQUARED = 1 / (1 - FLATTENING) ** 2 - 1;
const DIRECT_STEPS = 5;
const INVERSE_STEPS = 8;
const DEGREE = Math.PI / 180;

interface Arc {
  /** Sine of the geodesic's azimuth at the equator. */
  sinEquator: number;
  cosSquared: number;
  sine: number;
  cosine: number;
  /** Cosine of twice the arc from the equator to the geodesic's middle. */
  middle: number;
}

/** Latitude and longitude, degrees, of a place in a site's frame. */
export function wgs84(site: Origin, northM: number, eastM: number): Place {
  const end = endOf(site.origin_latitude_deg, northM, eastM);
  return {
    latitude: end.latitude / DEGREE,
    longitude: wrapped(site.origin_longitude_deg + end.apart / DEGREE),
  };
}

/** North and east in a site's frame, m, of a latitude and longitude in degrees. */
export function northEast(site: Origin, latitude: number, longitude: number): [number, number] {
  const [sin1, cos1] = reduced(site.origin_latitude_deg);
  const [sin2, cos2] = reduced(latitude);
  const apart = wrapped(longitude - site.origin_longitude_deg) * DEGREE;
  let turn = apart;
  for (let step = 0; ; step++) {
    const across = cos2 * Math.sin(turn);
    const along = cos1 * sin2 - sin1 * cos2 * Math.cos(turn);
    const sine = Math.hypot(across, along);
    if (sine === 0) return [0, 0];
    const cosine = sin1 * sin2 + cos1 * cos2 * Math.cos(turn);
    const sinEquator = (cos1 * across) / sine;
    const cosSquared = 1 - sinEquator ** 2;
    const lag = cosSquared > 0 ? (2 * sin1 * sin2) / cosSquared : 0;
    const arc = { sinEquator, cosSquared, sine, cosine, middle: unit(cosine - lag) };
    const angle = Math.atan2(sine, cosine);
    if (step === INVERSE_STEPS) {
      const distance = metresPerRadian(cosSquared) * (angle - lagOf(arc));
      return [(distance * along) / sine, (distance * across) / sine];
    }
    turn = apart + excess(arc, angle);
  }
}

/** What is added to a heading from the frame's north, rad, to have the one from true north. */
export function convergence(site: Origin, northM: number, eastM: number): number {
  return endOf(site.origin_latitude_deg, northM, eastM).turn;
}

function endOf(
  originLatitude: number,
  northM: number,
  eastM: number,
): { latitude: number; apart: number; turn: number } {
  const azimuth = Math.atan2(eastM, northM);
  const [sinAzimuth, cosAzimuth] = [Math.sin(azimuth), Math.cos(azimuth)];
  const [sin1, cos1] = reduced(originLatitude);
  const first = Math.atan2(sin1, cos1 * cosAzimuth);
  const sinEquator = cos1 * sinAzimuth;
  const cosSquared = 1 - sinEquator ** 2;
  const straight = Math.hypot(northM, eastM) / metresPerRadian(cosSquared);
  const arcOf = (angle: number): Arc => ({
    sinEquator,
    cosSquared,
    sine: Math.sin(angle),
    cosine: Math.cos(angle),
    middle: Math.cos(2 * first + angle),
  });
  let angle = straight;
  for (let step = 0; step < DIRECT_STEPS; step++) angle = straight + lagOf(arcOf(angle));
  const arc = arcOf(angle);
  const along = cos1 * arc.cosine * cosAzimuth - sin1 * arc.sine;
  const latitude = Math.atan2(
    sin1 * arc.cosine + cos1 * arc.sine * cosAzimuth,
    (1 - FLATTENING) * Math.hypot(sinEquator, along),
  );
  const turn = Math.atan2(arc.sine * sinAzimuth, cos1 * arc.cosine - sin1 * arc.sine * cosAzimuth);
  return {
    latitude,
    apart: turn - excess(arc, angle),
    turn: wrapped((Math.atan2(sinEquator, along) - azimuth) / DEGREE) * DEGREE,
  };
}

function reduced(latitude: number): [number, number] {
  const y = (1 - FLATTENING) * Math.sin(latitude * DEGREE);
  const x = Math.cos(latitude * DEGREE);
  const radius = Math.hypot(x, y);
  return [y / radius, x / radius];
}

function metresPerRadian(cosSquared: number): number {
  const u = cosSquared * SECOND_ECCENTRICITY_SQUARED;
  return POLE_M * (1 + (u / 16_384) * (4096 + u * (-768 + u * (320 - 175 * u))));
}

function lagOf({ cosSquared, sine, cosine, middle }: Arc): number {
  const u = cosSquared * SECOND_ECCENTRICITY_SQUARED;
  const b = (u / 1024) * (256 + u * (-128 + u * (74 - 47 * u)));
  const last = (b / 6) * middle * (-3 + 4 * sine ** 2) * (-3 + 4 * middle ** 2);
  return b * sine * (middle + (b / 4) * (cosine * (-1 + 2 * middle ** 2) - last));
}

function excess({ sinEquator, cosSquared, sine, cosine, middle }: Arc, angle: number): number {
  const c = (FLATTENING / 16) * cosSquared * (4 + FLATTENING * (4 - 3 * cosSquared));
  const inner = middle + c * cosine * (-1 + 2 * middle ** 2);
  return (1 - c) * FLATTENING * sinEquator * (angle + c * sine * inner);
}

function wrapped(degrees: number): number {
  return ((((degrees + 180) % 360) + 360) % 360) - 180;
}

function unit(value: number): number {
  return Math.max(-1, Math.min(1, value));
}
