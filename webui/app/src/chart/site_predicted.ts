import * as L from 'leaflet';
import { ellipseLine } from './flow_arrow';
import type { PredictedMark } from './predicted';

const LABEL_GAP_PX = 10;

interface Drawn {
  way: L.Polyline;
  ellipse: L.Polygon;
  place: L.CircleMarker;
  parts: L.LayerGroup;
}

/** Where robots that are not heard should be: the way, the 90 % ellipse and a hollow mark. */
export class SitePredicted {
  readonly group = L.layerGroup();
  readonly #drawn = new Map<string, Drawn>();

  show(marks: readonly PredictedMark[]): void {
    const ids = new Set(marks.map(({ id }) => id));
    for (const [id, { parts }] of this.#drawn) {
      if (ids.has(id)) continue;
      this.group.removeLayer(parts);
      this.#drawn.delete(id);
    }
    for (const { id, way, at, ellipseM, ellipseRad, label } of marks) {
      const drawn = this.#drawn.get(id) ?? this.#add(id);
      drawn.way.setLatLngs(way.map(([north, east]): [number, number] => [north, east]));
      const outline = ellipseLine(at[0], at[1], [ellipseM[0], ellipseM[1]], ellipseRad);
      drawn.ellipse.setLatLngs(outline.map(([north, east]): [number, number] => [north, east]));
      drawn.place.setLatLng([at[0], at[1]]).setTooltipContent(label);
    }
  }

  #add(id: string): Drawn {
    const way = L.polyline([], { className: 'map-predicted-way', interactive: false });
    const ellipse = L.polygon([], { className: 'map-predicted-ellipse', interactive: false });
    const place = L.circleMarker([0, 0], { radius: 6, className: 'map-predicted-place' });
    place.bindTooltip('', {
      permanent: true,
      direction: 'bottom',
      offset: [0, LABEL_GAP_PX],
      className: 'map-name map-predicted-name',
    });
    const parts = L.layerGroup([way, ellipse, place]);
    parts.addTo(this.group);
    const drawn = { way, ellipse, place, parts };
    this.#drawn.set(id, drawn);
    return drawn;
  }
}
