/** Places of a design as they are written and typed: in degrees, or in metres of the water. */
import { northEast, wgs84, type Origin } from '../../text/frame';
import { latitude, longitude, parsePosition, type PositionFormat } from '../../text/position';
import { plainNumber } from '../../text/unit';
import type { Spot } from './document';

export type PlaceFormat = PositionFormat | 'metres';

export const PLACE_FORMATS: readonly { key: PlaceFormat; title: string; help: string }[] = [
  { key: 'degrees', title: 'DD.D°', help: 'Degrees, such as 42.71000° N' },
  { key: 'minutes', title: 'DD MM.M′', help: 'Degrees and minutes, such as 42° 42.600′ N' },
  { key: 'seconds', title: 'DD MM SS″', help: 'Degrees, minutes and seconds' },
  { key: 'metres', title: 'N, E in m', help: 'Metres north and east in the frame of the water' },
];

const MM = 1000;

export function placeText(site: Origin, spot: Spot, format: PlaceFormat): string {
  if (format === 'metres') return `${plainNumber(spot.north_m, 9)}, ${plainNumber(spot.east_m, 9)}`;
  const place = wgs84(site, spot.north_m, spot.east_m);
  return `${latitude(place.latitude, format)} ${longitude(place.longitude, format)}`;
}

/** A place as it is typed: any notation of degrees, or north and east in metres. */
export function parsePlace(site: Origin, text: string, format: PlaceFormat): Spot | null {
  if (format === 'metres') return parseMetres(text);
  const place = parsePosition(text);
  if (place === null) return null;
  const [north, east] = northEast(site, place.latitude, place.longitude);
  return { north_m: Math.round(north * MM) / MM, east_m: Math.round(east * MM) / MM };
}

const METRES =
  /^\s*([+-]?[\d.]+)\s*(?:m\s*)?(?:[nN]\b)?\s*[,;\s]\s*([+-]?[\d.]+)\s*(?:m\s*)?(?:[eE]\b)?\s*$/;

function parseMetres(text: string): Spot | null {
  const found = METRES.exec(text.replaceAll('\u2212', '-'));
  const [north, east] = [Number(found?.[1]), Number(found?.[2])];
  if (!found || !Number.isFinite(north) || !Number.isFinite(east)) return null;
  return { north_m: Math.round(north * MM) / MM, east_m: Math.round(east * MM) / MM };
}

/** A number as it is typed, with a comma or a true minus sign; `null` for nothing, NaN for none. */
export function parseNumber(text: string): number | null {
  const plain = text.trim().replaceAll('\u2212', '-').replace(',', '.');
  return plain === '' ? null : Number(plain);
}
