import * as L from 'leaflet';
import type { Area, Box, ComesUp, Flow, FlownPoint, Leg, Ned, Site, Track } from '../api/types';
import { fixed } from '../text/unit';
import { PRIMITIVES } from '../text/word';
import { arrowLines, ellipseLine, flowText, scaleOf, told, type Line } from './flow_arrow';
import { fidelityRuns, legPoints, type ExpectedWay } from './path';
import { SiteAreas, type AreaHandlers } from './site_areas';
import { ticks } from './slice';

export interface MapRobot {
  id: string;
  name: string;
  ned: Ned;
  headingRad: number;
  stdM: number;
  /** Older than its limit: drawn hollow. */
  isOld: boolean;
  /** How far it may have drifted by now, m; predicted, null where that is no more than stated. */
  offM: number | null;
}

interface Mark {
  marker: L.Marker;
  arrow: SVGElement;
  circle: L.Circle;
  off: L.Circle;
}

/** Room for the label of one line of the grid, px. */
const LABEL_PX = 72;
/** Between a robot and its name, px. */
const NAME_GAP_PX = 12;
/** What a tooltip keeps from an arrow that ours has not, and from the edge, px. */
const EDGE_PX = 8;
const SVG = 'http://www.w3.org/2000/svg';

/**
 * A site seen from above, north up, in metres of its own north-east frame.
 *
 * Needs no tiles and no network. Every colour comes from the theme by class names.
 */
export class SiteDrawing {
  readonly #map: L.Map;
  readonly #track = L.layerGroup();
  readonly #plan = L.layerGroup();
  readonly #ghost = L.layerGroup();
  readonly #rehearsed = L.layerGroup();
  readonly #flow = L.layerGroup();
  readonly #comesUp = L.layerGroup();
  readonly #robots = L.layerGroup();
  readonly #areas: SiteAreas;
  readonly #marks = new Map<string, Mark>();
  readonly #bounds: L.LatLngBounds;

  constructor(host: HTMLElement, site: Site, onHover: (ned: [number, number] | null) => void) {
    const map = L.map(host, {
      crs: L.CRS.Simple,
      zoomSnap: 0,
      zoomDelta: 0.5,
      minZoom: -10,
      maxZoom: 14,
      attributionControl: false,
      zoomControl: false,
      scrollWheelZoom: true,
      keyboard: false,
      zoomAnimation: false,
    });
    this.#map = map;
    this.#bounds = boundsOf(site.water);
    drawFrame(map, site);
    this.#areas = new SiteAreas(map);
    this.#flow.addTo(map);
    this.#track.addTo(map);
    this.#comesUp.addTo(map);
    this.#rehearsed.addTo(map);
    this.#plan.addTo(map);
    this.#ghost.addTo(map);
    this.#robots.addTo(map);
    map.on('mousemove', (event) => onHover([event.latlng.lat, event.latlng.lng]));
    map.on('mouseout', () => onHover(null));
    host.addEventListener('pointerleave', () => onHover(null));
    map.on('dblclick', () => this.fit());
    map.on('moveend zoomend', () => this.#turnNames());
    map.doubleClickZoom.disable();
    this.fit();
  }

  fit(): void {
    this.#map.invalidateSize(false);
    this.#map.fitBounds(this.#bounds, { padding: [26, 18], animate: false });
    this.#turnNames();
  }

  remove(): void {
    this.#map.remove();
  }

  showTracks(tracks: readonly Track[]): void {
    this.#track.clearLayers();
    for (const run of tracks.flatMap(fidelityRuns)) {
      L.polyline(run.points, {
        className: `map-track map-fidelity-${run.level ?? 'none'}`,
        interactive: false,
      }).addTo(this.#track);
    }
  }

  /**
   * Plans by primitive, dashed: predicted, wherever the plan is; solid is what was flown.
   *
   * Where a track is expected it is drawn so, and the legs are a thin line beside it.
   */
  showPlans(plans: readonly (readonly Leg[])[], expected: readonly ExpectedWay[]): void {
    this.#plan.clearLayers();
    const legs = plans.flat().map((leg) => ({ kind: leg.kind, points: legPoints(leg) }));
    const flat = ({ points }: ExpectedWay) =>
      points.map(([north, east]): [number, number] => [north, east]);
    if (expected.length > 0) {
      for (const leg of legs) {
        L.polyline(flat(leg), { className: 'map-straight', interactive: false }).addTo(this.#plan);
      }
    }
    for (const way of expected.length > 0 ? expected : legs) {
      L.polyline(flat(way), { className: `map-leg map-${way.kind}` })
        .bindTooltip(PRIMITIVES[way.kind].title, { sticky: true })
        .addTo(this.#plan);
    }
    for (const { start_ned: start } of plans.flatMap(([first]) => first ?? [])) {
      L.circleMarker([start[0], start[1]], { radius: 4, className: 'map-start' })
        .bindTooltip('Start of the plan')
        .addTo(this.#plan);
    }
  }

  /** Another plan over the first, such as a runner-up that is pointed at. */
  showGhost(legs: readonly Leg[]): void {
    this.#ghost.clearLayers();
    for (const leg of legs) {
      const points = legPoints(leg).map(([north, east]): [number, number] => [north, east]);
      L.polyline(points, { className: 'map-ghost', interactive: false }).addTo(this.#ghost);
    }
  }

  /** Where a rehearsal went: computed, and not what was promised either. */
  showRehearsal(flown: readonly FlownPoint[]): void {
    this.#rehearsed.clearLayers();
    if (flown.length < 2) return;
    L.polyline(
      flown.map(([, north, east]): [number, number] => [north, east]),
      { className: 'map-rehearsed', interactive: false },
    ).addTo(this.#rehearsed);
  }

  /**
   * Arrows of the current, each with the ellipse that holds its tip in 9 of 10 cases: paler where
   * they are not sure, dashed where they are predicted.
   */
  showFlow(flow: Flow | null): void {
    this.#flow.clearLayers();
    if (!flow) return;
    const scale = scaleOf(flow.arrows, flow.spacing_m);
    for (const arrow of told(flow.arrows)) {
      const manner = `${arrow.is_sure ? '' : ' map-unsure'}${flow.is_predicted ? ' map-predicted' : ''}`;
      const { north_m: north, east_m: east, ellipse_m_s: axes, ellipse_rad: turn } = arrow;
      const tip = arrow.velocity_ne_m_s.map((speed) => scale * speed) as [number, number];
      const doubt = ellipseLine(
        north + tip[0],
        east + tip[1],
        [scale * axes[0], scale * axes[1]],
        turn,
      );
      L.polygon(plain(doubt), {
        className: `map-flow-doubt${manner}`,
        interactive: false,
      }).addTo(this.#flow);
      for (const line of arrowLines(arrow, scale)) {
        L.polyline(plain(line), { className: `map-flow${manner}`, interactive: false }).addTo(
          this.#flow,
        );
      }
      // A shaft of two pixels cannot be pointed at or tapped: its surroundings answer for it.
      L.circle([north + tip[0] / 2, east + tip[1] / 2], {
        radius: 0.4 * flow.spacing_m,
        className: 'map-flow-touch',
      })
        .bindTooltip(flowText(arrow), { sticky: true })
        .addTo(this.#flow);
    }
  }

  /** Where dives will come up: the ellipse that holds each in 9 of 10 cases. */
  showComesUp(places: readonly ComesUp[]): void {
    this.#comesUp.clearLayers();
    for (const one of places) {
      const [north, east] = one.drift_ne_m;
      const outline = ellipseLine(one.north_m, one.east_m, one.ellipse_m, one.ellipse_rad);
      L.polygon(plain(outline), { className: 'map-comes-up' })
        .bindTooltip(
          `Comes up here in 9 of 10 cases; drift of the dive ${fixed(Math.hypot(north, east), 1)} m`,
          { sticky: true },
        )
        .addTo(this.#comesUp);
    }
  }

  showAreas(
    areas: readonly Area[],
    selected: number | null,
    drawing: readonly (readonly [number, number])[] | null,
    handlers: AreaHandlers | null,
  ): void {
    this.#areas.show(areas, selected, handlers);
    this.#areas.showDrawing(drawing);
  }

  showRobots(robots: readonly MapRobot[]): void {
    for (const robot of robots) {
      const mark = this.#marks.get(robot.id) ?? this.#addRobot(robot);
      const at: [number, number] = [robot.ned[0], robot.ned[1]];
      mark.marker.setLatLng(at);
      mark.circle.setLatLng(at).setRadius(Math.max(robot.stdM, 1e-3));
      mark.off.setLatLng(at).setRadius(robot.offM ?? 1e-3);
      const degrees = (robot.headingRad * 180) / Math.PI;
      mark.arrow.setAttribute('transform', `rotate(${degrees.toFixed(1)} 14 14)`);
      mark.marker.getElement()?.classList.toggle('map-old', robot.isOld);
    }
    this.#turnNames();
  }

  /** A name that would be cut at the right edge stands on the left of its robot. */
  #turnNames(): void {
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
    const off = L.circle([0, 0], { radius: 1e-3, className: 'map-off', interactive: false });
    off.addTo(this.#robots);
    circle.addTo(this.#robots);
    marker.addTo(this.#robots);
    const mark = { marker, arrow, circle, off };
    this.#marks.set(robot.id, mark);
    return mark;
  }
}

function boundsOf(box: Box): L.LatLngBounds {
  return L.latLngBounds([box.x_min_m, box.y_min_m], [box.x_max_m, box.y_max_m]);
}

function drawFrame(map: L.Map, site: Site): void {
  const { water } = site;
  const still = { interactive: false };
  const reach = Math.max(water.x_max_m - water.x_min_m, water.y_max_m - water.y_min_m);
  const distance = (m: number) =>
    reach < 5000 ? `${fixed(m, reach < 5 ? 1 : 0)} m` : `${fixed(m / 1000, 0)} km`;
  const land = site.shoreline ? ' map-land' : '';
  L.rectangle(boundsOf(water), {
    ...still,
    className: `map-water map-${site.kind}${land}`,
  }).addTo(map);
  const label = (at: [number, number], text: string, side: string) =>
    L.marker(at, {
      icon: L.divIcon({ html: text, className: `map-label map-label-${side}`, iconSize: [0, 0] }),
      interactive: false,
      keyboard: false,
    }).addTo(map);
  // At the scale that shows all of the water; a label needs this much room.
  const size = map.getSize();
  const scale = Math.min(
    size.x / (water.y_max_m - water.y_min_m),
    size.y / (water.x_max_m - water.x_min_m),
  );
  const count = (span: number, most: number) =>
    scale > 0 ? Math.max(1, Math.min(most, Math.floor((span * scale) / LABEL_PX))) : most;
  const easts = count(water.y_max_m - water.y_min_m, 5);
  for (const east of ticks(water.y_min_m, water.y_max_m, easts)) {
    const line: [number, number][] = [
      [water.x_min_m, east],
      [water.x_max_m, east],
    ];
    L.polyline(line, { ...still, className: 'map-grid' }).addTo(map);
    label([water.x_min_m, east], `${distance(east)} E`, 'below');
  }
  for (const north of ticks(water.x_min_m, water.x_max_m, 4)) {
    const line: [number, number][] = [
      [north, water.y_min_m],
      [north, water.y_max_m],
    ];
    L.polyline(line, { ...still, className: 'map-grid' }).addTo(map);
    label([north, water.y_min_m], `${distance(north)} N`, 'inside');
  }
  if (site.shoreline) {
    L.polygon(
      site.shoreline.corners_m.map(([north, east]) => [north, east]),
      { ...still, className: 'map-shore' },
    ).addTo(map);
  }
  L.rectangle(boundsOf(site.domain), { ...still, className: 'map-domain' }).addTo(map);
}

function plain(line: Line): [number, number][] {
  return line.map(([north, east]): [number, number] => [north, east]);
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
