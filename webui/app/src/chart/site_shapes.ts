import * as L from 'leaflet';
import type { NorthEast } from '../api/types';

/** Something with a name on a map that cannot be changed there. */
export interface MapShape {
  name: string;
  kind: 'outline' | 'island' | 'keep_out' | 'place' | 'other';
  /** Lines, or the rings of an area, or the one corner of a point. */
  lines: readonly (readonly NorthEast[])[];
  isArea: boolean;
}

const CLASSES: Record<MapShape['kind'], string> = {
  outline: 'map-outline',
  island: 'map-island',
  keep_out: 'map-keep-out',
  place: 'map-place',
  other: 'map-other',
};

export function drawShapes(layer: L.LayerGroup, shapes: readonly MapShape[]): void {
  layer.clearLayers();
  for (const shape of shapes) pictureOf(shape)?.addTo(layer);
}

function pictureOf({ name, kind, lines, isArea }: MapShape): L.Layer | null {
  const className = CLASSES[kind];
  const rings = lines.map((line) => line.map(([n, e]): [number, number] => [n, e]));
  const [first] = rings[0] ?? [];
  if (!first) return null;
  const isPoint = rings.length === 1 && rings[0]?.length === 1;
  const made = isPoint
    ? L.circleMarker(first, { radius: 5, className })
    : isArea
      ? L.polygon(rings, { className })
      : L.polyline(rings, { className: `${className} map-line` });
  return name ? made.bindTooltip(name, { sticky: !isPoint }) : made;
}
