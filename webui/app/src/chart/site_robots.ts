import * as L from 'leaflet';
import type { Ned } from '../api/types';
import { uncovered } from './uncovered';

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

/** Between a robot and its name, px. */
const NAME_GAP_PX = 12;
/** What a tooltip keeps from an arrow that ours has not, and from the edge, px. */
const EDGE_PX = 8;
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

  /** A name that would be cut at the right edge stands on the left of its robot. */
  turnNames(): void {
    const width = this.#map.getSize().x;
    for (const { marker } of this.#marks.values()) {
      const tooltip = marker.getTooltip();
      const element = tooltip?.getElement();
      if (!tooltip || !element) continue;
      const { x } = this.#map.latLngToContainerPoint(marker.getLatLng());
      const isCut = x + NAME_GAP_PX + this.#sizeOf(element).width + EDGE_PX > width;
      const direction = isCut ? 'left' : 'right';
      if (tooltip.options.direction === direction) continue;
      tooltip.options.direction = direction;
      tooltip.options.offset = L.point(isCut ? -NAME_GAP_PX : NAME_GAP_PX, 0);
      tooltip.update();
    }
    this.#hideCovered();
  }

  /** Of names that would cover one another the first stands; a robot's mark is always drawn. */
  #hideCovered(): void {
    const names = [...this.#marks.values()].flatMap(({ marker }) => {
      const element = marker.getTooltip()?.getElement();
      if (!element) return [];
      const { x, y } = this.#map.latLngToContainerPoint(marker.getLatLng());
      const isLeft = marker.getTooltip()?.options.direction === 'left';
      const { width, height } = this.#sizeOf(element);
      const left = isLeft ? x - NAME_GAP_PX - width : x + NAME_GAP_PX;
      return [{ element, box: { left, top: y - height / 2, width, height } }];
    });
    const shown = uncovered(names.map(({ box }) => box));
    for (const [at, { element }] of names.entries()) {
      element.classList.toggle('map-name-covered', !shown[at]);
    }
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
      offset: [NAME_GAP_PX, 0],
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
