/** What an operator lays over every map for as long as the app is open, such as other vessels. */

import type { NorthEast, Site } from '../api/types';
import { northEast } from '../text/frame';
import type { MapShape } from './site_shapes';

type Place = readonly [longitude: number, latitude: number];

export interface OverlayFeature {
  name: string;
  lines: readonly (readonly Place[])[];
  isArea: boolean;
}

const FEATURES_MAX = 5000;
const CORNERS_MAX = 100_000;
const NAMES = ['name', 'Name', 'title', 'vessel', 'ship', 'callsign', 'mmsi', 'MMSI', 'id'];

class Overlay {
  /** Name of the file; empty while there is none. */
  file = $state('');
  features = $state.raw<readonly OverlayFeature[]>([]);
  refusal = $state('');

  async take(file: File): Promise<void> {
    try {
      this.features = readGeoJson(JSON.parse(await file.text()));
      this.file = file.name;
      this.refusal = '';
    } catch (error) {
      const why = error instanceof SyntaxError ? 'it is no JSON' : (error as Error).message;
      this.refusal = `${file.name} is refused: ${why}.`;
    }
  }

  drop(): void {
    this.features = [];
    this.file = this.refusal = '';
  }

  /** The features in the frame of a site. */
  shapes(site: Pick<Site, 'origin_latitude_deg' | 'origin_longitude_deg'>): MapShape[] {
    const placed = ([longitude, latitude]: Place): NorthEast =>
      northEast(site, latitude, longitude);
    return this.features.map(({ name, lines, isArea }) => ({
      name,
      kind: 'other',
      lines: lines.map((line) => line.map(placed)),
      isArea,
    }));
  }
}

/** One for all maps. */
export const overlay = new Overlay();

/** The features of a GeoJSON document (RFC 7946, WGS84); what is wrong is named by its number. */
export function readGeoJson(given: unknown): OverlayFeature[] {
  const document = given as { type?: unknown; features?: unknown } | null;
  const all = document?.type === 'FeatureCollection' ? document.features : [given];
  if (!Array.isArray(all)) throw new Error('it holds no features');
  if (all.length > FEATURES_MAX) throw new Error(`it has more than ${FEATURES_MAX} features`);
  const found = all.flatMap((one, i) => featuresOf(one, i + 1));
  const corners = found.flatMap(({ lines }) => lines).reduce((sum, one) => sum + one.length, 0);
  if (corners > CORNERS_MAX) throw new Error(`it has more than ${CORNERS_MAX} corners`);
  if (found.length === 0) throw new Error('it holds no features');
  return found;
}

function featuresOf(given: unknown, number: number): OverlayFeature[] {
  const feature = given as { type?: string; geometry?: unknown; properties?: unknown } | null;
  const geometry = (feature?.type === 'Feature' ? feature.geometry : feature) as {
    type?: string;
    coordinates?: unknown;
  } | null;
  if (!geometry) return [];
  const properties = (feature?.properties ?? {}) as Record<string, unknown>;
  const called = NAMES.map((key) => properties[key]).find(
    (value) => typeof value === 'string' || typeof value === 'number',
  );
  const name = String(called ?? `Feature ${number}`);
  const parts = partsOf(geometry.type, geometry.coordinates);
  if (!parts) throw new Error(`feature ${number} has no geometry that a map can show`);
  const isArea = geometry.type?.endsWith('Polygon') ?? false;
  return parts.map((lines) => ({
    name,
    lines: lines.map((line) => line.map((at) => placeOf(at, number))),
    isArea,
  }));
}

/** Each part of a geometry as its lines. */
function partsOf(type: string | undefined, given: unknown): unknown[][][] | null {
  if (!Array.isArray(given)) return null;
  if (type === 'Point') return [[[given]]];
  if (type === 'MultiPoint') return given.map((at) => [[at]]);
  if (type === 'LineString') return [[given]];
  const isNested = given.every((one) => Array.isArray(one));
  if (!isNested) return null;
  if (type === 'MultiLineString' || type === 'Polygon') return [given as unknown[][]];
  return type === 'MultiPolygon' ? (given as unknown[][][]) : null;
}

function placeOf(given: unknown, number: number): Place {
  const [longitude, latitude] = Array.isArray(given) ? (given as unknown[]) : [];
  const isPlace =
    typeof longitude === 'number' &&
    typeof latitude === 'number' &&
    Math.abs(longitude) <= 180 &&
    Math.abs(latitude) <= 90;
  if (!isPlace) throw new Error(`feature ${number} has a corner that is no WGS84 position`);
  return [longitude, latitude];
}
