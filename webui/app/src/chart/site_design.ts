import * as L from 'leaflet';
import type { NorthEast } from '../api/types';
import { SpotGesture, type Grip, type Gripped, type Pixel } from './spot_gesture';

interface Spot {
  readonly north_m: number;
  readonly east_m: number;
}

/** A design as it lies on the map. */
export interface DesignPicture {
  spots: readonly Spot[];
  shape: 'way' | 'area' | 'line' | 'place';
  /** Whether the way leads back to its first place. */
  returns: boolean;
  /** Chosen places by their number from 0. */
  chosen: ReadonlySet<number>;
  /** The way that a pattern becomes. */
  way: readonly NorthEast[];
  /** Radius of its circle, m; `null` for none. */
  radiusM: number | null;
  /** Places and legs by number, and places of the water, where something is violated. */
  faults: {
    spots: ReadonlySet<number>;
    lines: readonly (readonly NorthEast[])[];
    places: readonly { at: NorthEast; text: string }[];
  };
  /** What a click or a drag over free water means. */
  mode: 'move' | 'add' | 'choose';
  isEditable: boolean;
  most: number;
}

export interface DesignHandlers {
  /** A click on free water. */
  onwater: (north: number, east: number) => void;
  onpick: (index: number, isMore: boolean) => void;
  onbegin: (grip: Grip, north: number, east: number) => void;
  ondrag: (north: number, east: number) => void;
  onend: (isKept: boolean) => void;
  onchoose: (indexes: readonly number[], isMore: boolean) => void;
}

/** Shorter legs have no handle in their middle, px. */
const LEG_ROOM_PX = 46;
/** From the box around what is chosen to its handles, px. */
const HANDLE_PX = 22;
/** More places are dots without a number. */
const NUMBERED_MAX = 150;

/** The places of a design on a map, and the gestures that change them. */
export class SiteDesign {
  readonly #map: L.Map;
  readonly #group = L.layerGroup();
  readonly #still = { interactive: false } as const;
  readonly #way = L.polyline([], { ...this.#still, className: 'map-design-way' });
  readonly #outline = L.polyline([], { ...this.#still, className: 'map-design-outline' });
  readonly #faults = L.layerGroup();
  readonly #handles = L.layerGroup();
  readonly #circle = L.layerGroup();
  readonly #band = L.rectangle(
    [
      [0, 0],
      [0, 0],
    ],
    { ...this.#still, className: 'map-design-band' },
  );
  #marks: { mark: L.Marker; spot: Spot; look: string }[] = [];
  #picture: DesignPicture | null = null;
  #grips: Gripped[] | null = null;
  #gesture: SpotGesture | null = null;
  #handlers: DesignHandlers | null = null;
  #frame = 0;

  constructor(map: L.Map) {
    this.#map = map;
    this.#group.addLayer(this.#outline).addLayer(this.#way);
    for (const layer of [this.#faults, this.#circle, this.#handles]) this.#group.addLayer(layer);
    map.on('zoomend moveend resize', () => this.#lie());
    map.on('click', ({ latlng }) => {
      if (this.#picture) this.#handlers?.onwater(latlng.lat, latlng.lng);
    });
  }

  show(picture: DesignPicture | null, handlers: DesignHandlers | null): void {
    const before = this.#picture;
    this.#picture = picture;
    this.#handlers = handlers;
    if (!picture) {
      this.#group.remove();
      this.#gesture?.stop();
      this.#gesture = null;
      this.#map.boxZoom.enable();
      return;
    }
    this.#group.addTo(this.#map);
    this.#listen();
    const drawn = picture.spots.map(place);
    const isArea = picture.shape === 'area';
    const closes = isArea || (picture.returns && drawn.length > 1);
    const ring = closes ? [...drawn, ...drawn.slice(0, 1)] : drawn;
    const isWay = picture.shape === 'way';
    this.#outline.setLatLngs(isWay ? [] : ring);
    this.#way.setLatLngs(isWay ? ring : picture.way.map(([north, east]) => L.latLng(north, east)));
    this.#showMarks(picture);
    this.#showCircle(picture);
    if (before?.faults !== picture.faults) this.#showFaults(picture);
    this.#map.getContainer().classList.toggle('map-drawing', picture.mode !== 'move');
    this.#lie();
  }

  #listen(): void {
    if (this.#gesture) return;
    this.#map.boxZoom.disable();
    this.#gesture = new SpotGesture(this.#map.getContainer(), {
      grips: () => this.#gripList(),
      bands: () => this.#picture?.mode === 'choose',
      onpick: (...picked) => this.#pick(...picked),
      onbegin: (grip, at) => {
        this.#handles.clearLayers();
        this.#handlers?.onbegin(grip, ...this.#where(at));
      },
      ondrag: (at) => this.#handlers?.ondrag(...this.#where(at)),
      onend: (isKept) => {
        this.#handlers?.onend(isKept);
        this.#lie();
      },
      onband: (...band) => this.#drawBand(...band),
    });
  }

  #where(at: Pixel): [north: number, east: number] {
    const { lat, lng } = this.#map.containerPointToLatLng([at.x, at.y]);
    return [lat, lng];
  }

  #pick(grip: Grip, isMore: boolean, at: Pixel): void {
    if (grip.kind === 'spot') this.#handlers?.onpick(grip.index, isMore);
    if (grip.kind !== 'leg') return;
    this.#handlers?.onbegin(grip, ...this.#where(at));
    this.#handlers?.onend(true);
  }

  #drawBand(from: Pixel, to: Pixel, isOver: boolean, isMore: boolean): void {
    const [a, b] = [L.latLng(this.#where(from)), L.latLng(this.#where(to))];
    if (!isOver) {
      this.#band.setBounds(L.latLngBounds(a, b)).addTo(this.#map);
      return;
    }
    this.#band.remove();
    const bounds = L.latLngBounds(a, b);
    const inside = (this.#picture?.spots ?? []).flatMap((spot, i) =>
      bounds.contains(place(spot)) ? [i] : [],
    );
    this.#handlers?.onchoose(inside, isMore);
  }

  #showCircle({ spots: [centre], radiusM }: DesignPicture): void {
    this.#circle.clearLayers();
    if (radiusM === null || !centre) return;
    const look = { radius: radiusM, className: 'map-design-outline' };
    L.circle(place(centre), { ...look, ...this.#still }).addTo(this.#circle);
  }

  #showMarks({ spots, chosen, faults, shape }: DesignPicture): void {
    const isDotted = spots.length > NUMBERED_MAX;
    while (this.#marks.length > spots.length) this.#marks.pop()?.mark.remove();
    spots.forEach((spot, i) => {
      const look = [
        `map-spot map-spot-${shape}`,
        isDotted ? 'map-spot-dot' : '',
        chosen.has(i) ? 'map-spot-chosen' : '',
        faults.spots.has(i) ? 'map-spot-faulty' : '',
      ].join(' ');
      const known = this.#marks[i];
      if (known?.look === look) {
        if (known.spot !== spot) known.mark.setLatLng(place(spot));
        known.spot = spot;
        return;
      }
      known?.mark.remove();
      const mark = spotMark(spot, look, shape === 'place' || isDotted ? '' : String(i + 1));
      mark.addTo(this.#group);
      this.#marks[i] = { mark, spot, look };
    });
  }

  #showFaults({ faults }: DesignPicture): void {
    this.#faults.clearLayers();
    for (const line of faults.lines) {
      const drawn = line.map(([north, east]): [number, number] => [north, east]);
      L.polyline(drawn, { className: 'map-design-fault', interactive: false }).addTo(this.#faults);
    }
    for (const { at, text } of faults.places) {
      L.circleMarker([at[0], at[1]], { radius: 9, className: 'map-design-fault-place' })
        .bindTooltip(text)
        .addTo(this.#faults);
    }
  }

  /** Handles and grips anew where the view or the design has changed; once a picture. */
  #lie(): void {
    this.#grips = null;
    if (this.#frame || this.#gesture?.isDragging) return;
    this.#frame = requestAnimationFrame(() => {
      this.#frame = 0;
      this.#showHandles();
    });
  }

  #showHandles(): void {
    this.#handles.clearLayers();
    if (!this.#picture) return;
    for (const { grip, at } of this.#gripList()) {
      if (grip.kind === 'spot') continue;
      const size = grip.kind === 'leg' ? 9 : 12;
      const className = `map-grip map-grip-${grip.kind}`;
      const icon = L.divIcon({ className, iconSize: [size, size] });
      const point = this.#map.containerPointToLatLng([at.x, at.y]);
      L.marker(point, { icon, ...this.#still, keyboard: false }).addTo(this.#handles);
    }
  }

  #gripList(): readonly Gripped[] {
    this.#grips ??= this.#picture?.isEditable ? this.#makeGrips(this.#picture) : [];
    return this.#grips;
  }

  #makeGrips(picture: DesignPicture): Gripped[] {
    const { spots, chosen, shape, returns, radiusM, most } = picture;
    const points = spots.map((spot) => this.#map.latLngToContainerPoint(place(spot)));
    const grips: Gripped[] = [];
    const closes = shape === 'area' || (shape === 'way' && returns);
    if (shape !== 'place' && spots.length < most) {
      points.forEach((from, index) => {
        const to = points[index + 1] ?? (closes ? points[0] : undefined);
        if (!to || from.distanceTo(to) < LEG_ROOM_PX) return;
        const at = { x: (from.x + to.x) / 2, y: (from.y + to.y) / 2 };
        grips.push({ grip: { kind: 'leg', index }, at });
      });
    }
    if (radiusM !== null && spots[0]) {
      const { north_m, east_m } = spots[0];
      const at = this.#map.latLngToContainerPoint([north_m, east_m + radiusM]);
      grips.push({ grip: { kind: 'radius' }, at });
    }
    const held = points.filter((_, i) => chosen.has(i));
    if (held.length > 1) {
      const box = L.bounds(held);
      const [low, high] = [box.getTopLeft(), box.getBottomRight()];
      const turn = { x: (low.x + high.x) / 2, y: low.y - HANDLE_PX };
      grips.push({ grip: { kind: 'turn' }, at: turn });
      const corner = { x: high.x + HANDLE_PX, y: high.y + HANDLE_PX };
      grips.push({ grip: { kind: 'scale' }, at: corner });
    }
    // Places last: where two things are equally near a place is meant.
    points.forEach((at, index) => grips.push({ grip: { kind: 'spot', index }, at }));
    return grips;
  }
}

function place({ north_m, east_m }: Spot): L.LatLng {
  return L.latLng(north_m, east_m);
}

function spotMark(spot: Spot, className: string, text: string): L.Marker {
  const size = className.includes('map-spot-dot') ? 10 : 20;
  const html = text && `<span>${text}</span>`;
  const icon = L.divIcon({ className, html, iconSize: [size, size] });
  return L.marker(place(spot), { icon, interactive: false, keyboard: false });
}
