import * as L from 'leaflet';
import type { Ned } from '../api/types';

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

  constructor(map: L.Map) {
    this.#map = map;
    this.#robots.addTo(map);
  }

  show(robots: readonly MapRobot[]): void {
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
      const isCut = x + NAME_GAP_PX + element.offsetWidth + EDGE_PX > width;
      const direction = isCut ? 'left' : 'right';
      if (tooltip.options.direction === direction) continue;
      tooltip.options.direction = direction;
      tooltip.options.offset = L.point(isCut ? -NAME_GAP_PX : NAME_GAP_PX, 0);
      tooltip.update();
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
