import * as L from 'leaflet';
import type { Ned } from '../api/types';
import { uncovered, type Box } from './uncovered';

export interface MapRobot {
  id: string;
  name: string;
  ned: Ned;
  headingRad: number;
  stdM: number;
  /** Older than its limit: drawn hollow. */
  isOld: boolean;
}

interface Mark {
  marker: L.Marker;
  arrow: SVGElement;
  circle: L.Circle;
}

/** Where a name stands, on which side of its robot. */
interface NamePlace extends Box {
  side: 'right' | 'left' | 'bottom' | 'top';
}

/** Between a robot and its name, px. */
const NAME_GAP_PX = 12;
/** The same with what Leaflet keeps for an arrow of tooltips. */
const FULL_GAP_PX = NAME_GAP_PX + 6;
/** Of the arrow of a robot, as far as names keep from it, px. */
const MARK_PX = 18;
/** What a name keeps from the edge, px. */
const EDGE_PX = 2;
const OFFSETS = {
  right: L.point(NAME_GAP_PX, 0),
  left: L.point(-NAME_GAP_PX, 0),
  bottom: L.point(0, NAME_GAP_PX),
  top: L.point(0, -NAME_GAP_PX),
};
const SVG = 'http://www.w3.org/2000/svg';

/** The robots of a site: where each is and points, and how surely. */
export class SiteRobots {
  readonly #map: L.Map;
  readonly #robots = L.layerGroup();
  readonly #marks = new Map<string, Mark>();
  readonly #sizes = new WeakMap<HTMLElement, { width: number; height: number }>();

  constructor(map: L.Map) {
    this.#map = map;
    this.#robots.addTo(map);
  }

  show(robots: readonly MapRobot[]): void {
    this.#forget(new Set(robots.map(({ id }) => id)));
    for (const robot of robots) {
      const mark = this.#marks.get(robot.id) ?? this.#addRobot(robot);
      const at: [number, number] = [robot.ned[0], robot.ned[1]];
      mark.marker.setLatLng(at);
      mark.circle.setLatLng(at).setRadius(Math.max(robot.stdM, 1e-3));
      const degrees = (robot.headingRad * 180) / Math.PI;
      mark.arrow.setAttribute('transform', `rotate(${degrees.toFixed(1)} 14 14)`);
      mark.marker.getElement()?.classList.toggle('map-old', robot.isOld);
    }
    this.turnNames();
  }

  /**
   * A name stands where it covers no mark and no other name and is not cut: on the right of its
   * robot, or else on another side. Where no side is free it is hidden until one zooms in.
   */
  turnNames(): void {
    const marks = [...this.#marks.values()].map(({ marker }) => {
      const { x, y } = this.#map.latLngToContainerPoint(marker.getLatLng());
      return { left: x - MARK_PX / 2, top: y - MARK_PX / 2, width: MARK_PX, height: MARK_PX };
    });
    const names = [...this.#marks.values()].flatMap(({ marker }) => {
      const tooltip = marker.getTooltip();
      const element = tooltip?.getElement();
      return tooltip && element
        ? [{ tooltip, element, places: this.#places(marker, element) }]
        : [];
    });
    const placed = uncovered(
      names.map(({ places }) => places),
      marks,
    );
    for (const [at, { tooltip, element }] of names.entries()) {
      const place = placed[at];
      element.classList.toggle('map-name-covered', !place);
      if (!place || tooltip.options.direction === place.side) continue;
      tooltip.options.direction = place.side;
      tooltip.options.offset = OFFSETS[place.side];
      tooltip.update();
    }
  }

  /** Where a name can stand beside its robot without being cut, the best place first. */
  #places(marker: L.Marker, element: HTMLElement): NamePlace[] {
    const { x, y } = this.#map.latLngToContainerPoint(marker.getLatLng());
    const { width, height } = this.#sizeOf(element);
    const [beside, middle] = [y - height / 2, x - width / 2];
    const places: NamePlace[] = [
      { side: 'right', left: x + FULL_GAP_PX, top: beside, width, height },
      { side: 'left', left: x - FULL_GAP_PX - width, top: beside, width, height },
      { side: 'bottom', left: middle, top: y + FULL_GAP_PX, width, height },
      { side: 'top', left: middle, top: y - FULL_GAP_PX - height, width, height },
    ];
    const right = this.#map.getSize().x - EDGE_PX;
    return places.filter((place) => place.left >= EDGE_PX && place.left + width <= right);
  }

  /** A name keeps its size; asking for it each time would lay the page out anew. */
  #sizeOf(element: HTMLElement): { width: number; height: number } {
    let size = this.#sizes.get(element);
    if (!size?.width) {
      size = { width: element.offsetWidth, height: element.offsetHeight };
      this.#sizes.set(element, size);
    }
    return size;
  }

  /** Robots that a search leaves out are drawn no more. */
  #forget(shown: ReadonlySet<string>): void {
    for (const [id, { marker, circle }] of this.#marks) {
      if (shown.has(id)) continue;
      marker.remove();
      circle.remove();
      this.#robots.removeLayer(marker).removeLayer(circle);
      this.#marks.delete(id);
    }
  }

  #addRobot(robot: MapRobot): Mark {
    const { figure, arrow } = robotFigure();
    const icon = L.divIcon({
      html: figure as unknown as HTMLElement,
      className: 'map-robot',
      iconSize: [28, 28],
    });
    const marker = L.marker([0, 0], { icon, interactive: false, keyboard: false });
    marker.bindTooltip(robot.name, {
      permanent: true,
      direction: 'right',
      offset: OFFSETS.right,
      className: 'map-name',
    });
    const circle = L.circle([0, 0], { radius: 1, className: 'map-std', interactive: false });
    circle.addTo(this.#robots);
    marker.addTo(this.#robots);
    const mark = { marker, arrow, circle };
    this.#marks.set(robot.id, mark);
    return mark;
  }
}

function robotFigure(): { figure: SVGElement; arrow: SVGElement } {
  const figure = document.createElementNS(SVG, 'svg');
  figure.setAttribute('viewBox', '0 0 28 28');
  figure.setAttribute('width', '28');
  figure.setAttribute('height', '28');
  const arrow = document.createElementNS(SVG, 'path');
  arrow.setAttribute('d', 'M14 4 L19.5 21 L14 17.5 L8.5 21 Z');
  arrow.setAttribute('class', 'map-arrow');
  figure.append(arrow);
  return { figure, arrow };
}
