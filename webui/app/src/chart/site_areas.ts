import * as L from 'leaflet';
import type { Area } from '../api/types';

/** What the map may change of keep-outs; without it they are only shown. */
export interface AreaHandlers {
  /** Called when an area is clicked. */
  onpick: (index: number) => void;
  /** What an area is called; by default a keep-out of its name. */
  nameOf?: (index: number) => string;
  /** The area that is the shore, not a keep-out. */
  shore?: number | null;
  onmove: (index: number, corner: number, north: number, east: number) => void;
  /** Called to put a corner into the side behind one: a click on the side of the chosen area. */
  oninsert?: (index: number, corner: number, north: number, east: number) => void;
  /** Called to take a corner away: its second button or a long press. */
  onremove?: (index: number, corner: number) => void;
  /** Called with a click on the map while an area is drawn. */
  onclick: (north: number, east: number) => void;
}

/** What is being changed, and how the map may change it. */
export interface AreaEditing extends AreaHandlers {
  /** Area whose corners can be dragged. */
  selected: number | null;
  /** Corners clicked so far of an area that is being drawn; `null` while none is. */
  drawing: readonly (readonly [number, number])[] | null;
}

/** A click so near to a side is on it. */
const SIDE_PX = 9;

/** Areas of a site as polygons; the corners of the chosen one can be dragged. */
export class SiteAreas {
  readonly #map: L.Map;
  /** Everything but what is being drawn. */
  readonly group = L.layerGroup();
  readonly #drawn = L.layerGroup();
  #handlers: AreaHandlers | null = null;
  #isDrawing = false;
  #isDragged = false;

  constructor(map: L.Map) {
    this.#map = map;
    this.#drawn.addTo(map);
    map.on('click', ({ latlng }) => {
      if (this.#isDrawing) this.#handlers?.onclick(latlng.lat, latlng.lng);
    });
  }

  show(areas: readonly Area[], selected: number | null, handlers: AreaHandlers | null): void {
    this.#handlers = handlers;
    // What is being dragged follows the pointer by itself.
    if (this.#isDragged) return;
    this.group.clearLayers();
    areas.forEach((area, index) => this.#add(area, index, index === selected));
  }

  /** The corners clicked so far of an area that is being drawn; `null` while none is. */
  showDrawing(corners: readonly (readonly [number, number])[] | null): void {
    this.#isDrawing = corners !== null;
    this.#map.getContainer().classList.toggle('map-drawing', this.#isDrawing);
    this.#drawn.clearLayers();
    if (corners === null) return;
    const points = corners.map(([north, east]): [number, number] => [north, east]);
    L.polygon(points, { className: 'map-keep-out map-new', interactive: false }).addTo(this.#drawn);
    points.forEach((point) =>
      L.circleMarker(point, { radius: 4, className: 'map-corner', interactive: false }).addTo(
        this.#drawn,
      ),
    );
  }

  #add(area: Area, index: number, isSelected: boolean): void {
    const handlers = this.#handlers;
    const points = area.corners_m.map(([north, east]): [number, number] => [north, east]);
    const polygon = L.polygon(points, {
      className: `${handlers?.shore === index ? 'map-outline' : 'map-keep-out'}${isSelected ? ' map-chosen' : ''}`,
      interactive: true,
    });
    polygon
      .bindTooltip(handlers?.nameOf?.(index) ?? `Keep out: ${area.name}`, { sticky: true })
      .addTo(this.group);
    if (!handlers) return;
    polygon.on('click', ({ latlng }) => {
      if (this.#isDrawing) return;
      const side = isSelected ? this.#sideAt(points, latlng) : null;
      if (side === null) handlers.onpick(index);
      else handlers.oninsert?.(index, side, latlng.lat, latlng.lng);
    });
    if (!isSelected) return;
    points.forEach((point, corner) => this.#addHandle(polygon, index, corner, point, handlers));
  }

  /** The corner behind which the side lies that a place is on; `null` for none. */
  #sideAt(points: readonly [number, number][], at: L.LatLng): number | null {
    const here = this.#map.latLngToLayerPoint(at);
    const drawn = points.map((point) => this.#map.latLngToLayerPoint(point));
    const distances = drawn.map((from, i) =>
      L.LineUtil.pointToSegmentDistance(here, from, drawn[(i + 1) % drawn.length] ?? from),
    );
    const nearest = Math.min(...distances);
    return nearest <= SIDE_PX ? distances.indexOf(nearest) : null;
  }

  #addHandle(
    polygon: L.Polygon,
    index: number,
    corner: number,
    at: [number, number],
    handlers: AreaHandlers,
  ): void {
    const icon = L.divIcon({ className: 'map-handle', iconSize: [14, 14] });
    const handle = L.marker(at, { icon, draggable: true, keyboard: false, zIndexOffset: 1000 });
    handle.on('dragstart', () => (this.#isDragged = true));
    handle.on('drag', () => {
      const [ring] = polygon.getLatLngs() as L.LatLng[][];
      const moved = (ring ?? []).map((place, i) => (i === corner ? handle.getLatLng() : place));
      polygon.setLatLngs(moved);
    });
    handle.on('dragend', () => {
      this.#isDragged = false;
      const { lat, lng } = handle.getLatLng();
      handlers.onmove(index, corner, lat, lng);
    });
    handle.on('contextmenu', (event) => {
      L.DomEvent.stop(event.originalEvent);
      handlers.onremove?.(index, corner);
    });
    handle.addTo(this.group);
  }
}
