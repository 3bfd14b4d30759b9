import * as L from 'leaflet';
import { ellipseLine } from './flow_arrow';
import type { PredictedMark } from './predicted';
import { uncovered } from './uncovered';

const LABEL_GAP_PX = 10;

interface Drawn {
  way: L.Polyline;
  ellipse: L.Polygon;
  place: L.CircleMarker;
  parts: L.LayerGroup;
}

/**
 * Where robots are by another word than their own, as a way, an ellipse and a hollow mark: where
 * they should be while they are not heard (90 %), or where cameras saw them (95 %).
 */
export class SitePredicted {
  readonly #map: L.Map;
  readonly #look: string;
  readonly group = L.layerGroup();
  readonly #drawn = new Map<string, Drawn>();

  /**
   * @param map Where its group is shown.
   * @param look Beginning of its classes.
   */
  constructor(map: L.Map, look = 'map-predicted') {
    this.#map = map;
    this.#look = look;
    map.on('moveend zoomend', () => this.#hideCovered());
  }

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
    this.#hideCovered();
  }

  /** Of words that would cover one another the first stand, until one zooms in. */
  #hideCovered(): void {
    const words = [...this.#drawn.values()].flatMap(({ place }) => {
      const element = place.getTooltip()?.getElement();
      if (!element) return [];
      const { x, y } = this.#map.latLngToContainerPoint(place.getLatLng());
      const [width, height] = [element.offsetWidth, element.offsetHeight];
      return [{ element, box: { left: x - width / 2, top: y + LABEL_GAP_PX, width, height } }];
    });
    const shown = uncovered(words.map(({ box }) => [box]));
    for (const [at, { element }] of words.entries()) {
      element.classList.toggle('map-name-covered', !shown[at]);
    }
  }

  #add(id: string): Drawn {
    const way = L.polyline([], { className: `${this.#look}-way`, interactive: false });
    const ellipse = L.polygon([], { className: `${this.#look}-ellipse`, interactive: false });
    const place = L.circleMarker([0, 0], { radius: 6, className: `${this.#look}-place` });
    place.bindTooltip('', {
      permanent: true,
      direction: 'bottom',
      offset: [0, LABEL_GAP_PX],
      className: `map-name ${this.#look}-name`,
    });
    const parts = L.layerGroup([way, ellipse, place]);
    parts.addTo(this.group);
    const drawn = { way, ellipse, place, parts };
    this.#drawn.set(id, drawn);
    return drawn;
  }
}
