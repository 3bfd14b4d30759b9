import type * as L from 'leaflet';
import type { BaseMap } from '../api/types';
import type { Origin } from '../text/frame';
import {
  affineOf,
  tilesIn,
  zoomFor,
  type Affine,
  type Reach,
  type TilePlace,
} from './web_mercator';

const TILE_PX = 256;
/** Tiles larger than this on the screen tell nothing any more, px. */
const LARGEST_PX = 8192;
/** What tiles reach over one another, so that no seam is seen between them, px. */
const OVERLAP_PX = 0.6;

interface Tile {
  image: HTMLImageElement;
  affine: Affine;
  z: number;
}

/** Tiles of a base map, laid into a site's own frame. */
export class BaseLayer {
  readonly #map: L.Map;
  readonly #site: Origin;
  readonly #pane: HTMLElement;
  readonly #tiles = new Map<string, Tile>();
  #base: BaseMap | null = null;
  #frame = 0;

  constructor(map: L.Map, site: Origin, pane: HTMLElement) {
    this.#map = map;
    this.#site = site;
    this.#pane = pane;
    map.on('move zoom viewreset resize', () => this.#later());
  }

  show(base: BaseMap | null): void {
    const key = (one: BaseMap | null) => (one ? `${one.id} ${one.revision}` : '');
    if (key(base) === key(this.#base)) return;
    this.#base = base;
    this.#clear();
    this.#later();
  }

  remove(): void {
    cancelAnimationFrame(this.#frame);
    this.#clear();
  }

  #clear(): void {
    for (const { image } of this.#tiles.values()) image.remove();
    this.#tiles.clear();
  }

  #later(): void {
    cancelAnimationFrame(this.#frame);
    this.#frame = requestAnimationFrame(() => this.#update());
  }

  #update(): void {
    const base = this.#base;
    if (!base || this.#map.getSize().x === 0) return;
    const bounds = this.#map.getBounds();
    const reach: Reach = {
      north: [bounds.getSouth(), bounds.getNorth()],
      east: [bounds.getWest(), bounds.getEast()],
    };
    const perM = this.#map.getZoomScale(this.#map.getZoom(), 0);
    const latitude = this.#site.origin_latitude_deg;
    const z = zoomFor(latitude, perM, base, Math.min(2, devicePixelRatio));
    const wanted = tilesIn(this.#site, reach, base, z);
    const keys = new Set(wanted.map(({ x, y }) => `${z} ${x} ${y}`));
    for (const place of wanted) this.#add(base, place);
    this.#drop(keys, z);
    for (const tile of this.#tiles.values()) this.#lay(tile, perM);
  }

  #add(base: BaseMap, place: TilePlace): void {
    const { z, x, y } = place;
    const key = `${z} ${x} ${y}`;
    if (this.#tiles.has(key)) return;
    const image = new Image(TILE_PX, TILE_PX);
    image.className = 'map-tile';
    image.alt = '';
    image.draggable = false;
    image.onload = () => {
      image.classList.add('map-loaded');
      this.#later();
    };
    // No tile there: nothing is drawn, and it is not asked for again.
    image.onerror = () => {
      image.classList.add('map-loaded');
      image.hidden = true;
    };
    const column = ((x % 2 ** z) + 2 ** z) % 2 ** z;
    const revision = encodeURIComponent(base.revision);
    image.src = `/api/base-maps/${base.id}/tiles/${z}/${column}/${y}?revision=${revision}`;
    this.#pane.append(image);
    this.#tiles.set(key, { image, affine: affineOf(this.#site, place), z });
  }

  /** Tiles of another zoom stay until those in sight have come. */
  #drop(keys: ReadonlySet<string>, z: number): void {
    const isDone = [...keys].every((key) =>
      this.#tiles.get(key)?.image.classList.contains('map-loaded'),
    );
    for (const [key, tile] of this.#tiles) {
      if (keys.has(key) || (tile.z !== z && !isDone)) continue;
      tile.image.remove();
      this.#tiles.delete(key);
    }
  }

  #lay({ image, affine, z }: Tile, perM: number): void {
    const { right, down, corner } = affine;
    const size = Math.hypot(...right) * TILE_PX * perM;
    image.style.display = size > LARGEST_PX ? 'none' : '';
    image.style.zIndex = String(z);
    const at = this.#map.latLngToLayerPoint([-corner[1], corner[0]]);
    const grow = 1 + OVERLAP_PX / size;
    const numbers = [right, down].flatMap((side) => side.map((m) => m * perM * grow));
    image.style.transform = `matrix(${[...numbers, at.x, at.y].join(', ')})`;
  }
}
