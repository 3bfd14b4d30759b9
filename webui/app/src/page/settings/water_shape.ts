import type { ImportProposal, NorthEast, Site, WaterPlace } from '../../api/types';
import type { MapShape } from '../../chart/site_shapes';
import { parseNumber } from '../../form/check';
import { northEast, type Origin } from '../../text/frame';
import { latitude, longitude, parsePosition, type PositionFormat } from '../../text/position';

export type Role = 'outline' | 'island' | 'keep_out' | 'place' | 'ignored';

export interface PlaceDraft {
  name: string;
  kind: WaterPlace['kind'];
  /** As it is typed, in any notation. */
  position: string;
  /** What a text stands for that was written of a place, without what the notation rounds. */
  exact?: { text: string; latitude: number; longitude: number };
  depth: string;
}

/** What was read from a file and is to be part of the water. */
export interface FileDraft {
  proposal: ImportProposal;
  areHeights: boolean | null;
  roles: Record<number, Role>;
}

/** Name of the area that is the shore. */
export const OUTLINE = 'Outline';

/** The field of the form that a path of the request stands for. */
export function fieldOf(path: readonly string[]): string {
  const parts = path[0] === 'document' ? path.slice(1) : path;
  const [first = '', second = '', third = ''] = parts;
  if (first === 'shoreline' || first === 'water') return 'outline';
  if (first === 'places' && second) {
    const column =
      third.startsWith('latitude') || third.startsWith('longitude') ? 'position' : third;
    return `places.${second}.${column}`;
  }
  return first === 'keep_outs' && second ? `keep_outs.${second}` : first;
}

export function boxAround(north: number, east: number, tall: number, wide: number, deep: number) {
  return {
    x_min_m: north - tall,
    x_max_m: north + tall,
    y_min_m: east - wide,
    y_max_m: east + wide,
    depth_max_m: deep,
  };
}

export function boxOf(corners: readonly NorthEast[], deep: number) {
  const norths = corners.map(([north]) => north);
  const easts = corners.map(([, east]) => east);
  return {
    x_min_m: Math.min(...norths) - MARGIN_M,
    x_max_m: Math.max(...norths) + MARGIN_M,
    y_min_m: Math.min(...easts) - MARGIN_M,
    y_max_m: Math.max(...easts) + MARGIN_M,
    depth_max_m: deep,
  };
}

type Box = Site['water'];

export function within(inner: Box, outer: Box): Box {
  return {
    x_min_m: Math.max(inner.x_min_m, outer.x_min_m),
    x_max_m: Math.min(inner.x_max_m, outer.x_max_m),
    y_min_m: Math.max(inner.y_min_m, outer.y_min_m),
    y_max_m: Math.min(inner.y_max_m, outer.y_max_m),
    depth_max_m: Math.min(inner.depth_max_m, outer.depth_max_m),
  };
}
const MARGIN_M = 1;

interface Position {
  latitude: number;
  longitude: number;
}

/** A position as the form writes it, and exactly. */
export function written(
  at: Position,
  format: PositionFormat,
): Required<Pick<PlaceDraft, 'position' | 'exact'>> {
  const text = `${latitude(at.latitude, format)} ${longitude(at.longitude, format)}`;
  return { position: text, exact: { text, ...at } };
}

export function positionOf({ position, exact }: PlaceDraft): Position | null {
  return exact?.text === position ? exact : parsePosition(position);
}

/** What the features of files would become, in a frame. */
/** A place as the document of a water has it, in the frame of an origin. */
export function placeOf(place: PlaceDraft, origin: Origin) {
  const at = positionOf(place) ?? { latitude: 0, longitude: 0 };
  const [north, east] = northEast(origin, at.latitude, at.longitude);
  return {
    name: place.name.trim(),
    kind: place.kind,
    latitude_deg: at.latitude,
    longitude_deg: at.longitude,
    north_m: north,
    east_m: east,
    depth_m: parseNumber(place.depth) ?? 0,
  };
}

export function sketchesOf(files: readonly FileDraft[], frame: Origin): MapShape[] {
  const shapeOf = (one: ImportProposal['features'][number], kind: Role): MapShape[] => {
    if (kind === 'ignored') return [];
    const lines = one.sketch.map((line) =>
      line.map(([up, across]) => northEast(frame, up, across)),
    );
    return [{ name: one.name, kind, lines, isArea: one.geometry === 'polygon' }];
  };
  return files.flatMap(({ proposal, roles }) =>
    proposal.features.flatMap((one) => shapeOf(one, roles[one.number] ?? (one.role as Role))),
  );
}
