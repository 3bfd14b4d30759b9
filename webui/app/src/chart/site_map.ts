import * as L from 'leaflet';
import type { Area, BaseMap, ComesUp, Flow, FlownPoint, Leg, Site, Track } from '../api/types';
import { fixed } from '../text/unit';
import { PRIMITIVES } from '../text/word';
import { arrowLines, ellipseLine, flowText, scaleOf, told } from './flow_arrow';
import { BaseLayer } from './base_layer';
import { fidelityRuns, legPoints, type ExpectedWay } from './path';
import { SiteAreas, type AreaHandlers } from './site_areas';
import type { BandShape } from './flight_band';
import { bandRenderer, drawBand } from './site_band';
import { boundsOf, drawFrame, plain } from './site_frame';
import { SiteDesign, type DesignHandlers, type DesignPicture } from './site_design';
import { drawDepth, drawField, type FieldLevel } from './site_picture';
import type { PredictedMark } from './predicted';
import { SitePredicted } from './site_predicted';
import { drawShapes, type MapShape } from './site_shapes';
import { SiteRobots, type MapRobot } from './site_robots';
import type { Sight } from './target_view';

/** What a map can show or leave out. */
export type LayerKey =
  | 'base'
  | 'depth'
  | 'field'
  | 'keepouts'
  | 'flow'
  | 'track'
  | 'plan'
  | 'band'
  | 'predicted'
  | 'seen'
  | 'places'
  | 'others';

/** A place with a name. */
export interface MapPlace {
  name: string;
  kind: string;
  at: readonly [north: number, east: number];
}

/** How a site's metres lie on the screen, north up. */
export interface MapView {
  /** Pixels of a metre. */
  perM: number;
  width: number;
  height: number;
  /** Northing of the upper edge and easting of the left one, m. */
  top: number;
  left: number;
}

export interface MapHandlers {
  onhover: (at: [north: number, east: number] | null) => void;
  onclick: (at: [north: number, east: number]) => void;
  /** A long press, or the second button. */
  onask: (at: [north: number, east: number]) => void;
  onview: (view: MapView) => void;
}

/** From the lowest: the water, pictures of the ground, its depth, a field of the water, a band. */
const PANES = { water: 210, base: 220, depth: 230, field: 240, band: 300 } as const;
/**
 * A site seen from above, north up, in metres of its own north-east frame.
 *
 * Needs no tiles and no network. Every colour comes from the theme by class names.
 */
export class SiteDrawing {
  readonly #map: L.Map;
  readonly #groups: Record<Exclude<LayerKey, 'base'>, L.LayerGroup>;
  readonly #ghost = L.layerGroup();
  readonly #sketches = L.layerGroup();
  readonly #comesUp = L.layerGroup();
  readonly #rehearsed = L.layerGroup();
  readonly #expected = L.layerGroup();
  readonly #bands = bandRenderer('band');
  readonly #silent: SitePredicted;
  readonly #seen: SitePredicted;
  readonly #robots: SiteRobots;
  readonly #areas: SiteAreas;
  readonly #surveyed = L.layerGroup();
  readonly #design: SiteDesign;
  readonly #base: BaseLayer;
  readonly #water: L.LatLngBounds;
  readonly #site: Site;
  #sight: L.LatLngBounds;
  /** Whether the sight is still the one that was asked for. */
  #isFollowing = true;
  #isFitting = false;

  constructor(host: HTMLElement, site: Site, handlers: MapHandlers) {
    const map = L.map(host, {
      crs: L.CRS.Simple,
      zoomSnap: 0,
      zoomDelta: 0.5,
      minZoom: -14,
      maxZoom: 14,
      attributionControl: false,
      zoomControl: false,
      scrollWheelZoom: true,
      keyboard: true,
      keyboardPanDelta: 60,
      zoomAnimation: false,
    });
    this.#map = map;
    this.#site = site;
    this.#water = boundsOf(site.water);
    this.#sight = this.#water;
    for (const [name, z] of Object.entries(PANES)) map.createPane(name).style.zIndex = String(z);
    drawFrame(map, site);
    this.#base = new BaseLayer(map, site, map.getPane('base') ?? host);
    this.#areas = new SiteAreas(map);
    this.#surveyed.addTo(map);
    this.#silent = new SitePredicted(map);
    this.#seen = new SitePredicted(map, 'map-seen');
    const predicted = L.layerGroup([this.#comesUp, this.#rehearsed, this.#expected]);
    predicted.addLayer(this.#silent.group);
    this.#groups = {
      depth: L.layerGroup(),
      field: L.layerGroup(),
      keepouts: this.#areas.group,
      flow: L.layerGroup(),
      track: L.layerGroup(),
      band: L.layerGroup(),
      predicted,
      plan: L.layerGroup(),
      places: L.layerGroup(),
      others: L.layerGroup(),
      seen: this.#seen.group,
    };
    for (const group of Object.values(this.#groups)) group.addTo(map);
    this.#sketches.addTo(map);
    this.#ghost.addTo(map);
    this.#robots = new SiteRobots(map);
    this.#design = new SiteDesign(map);
    this.#listen(handlers);
    this.fit();
  }

  #listen(handlers: MapHandlers): void {
    const map = this.#map;
    const at = ({ latlng }: L.LeafletMouseEvent): [number, number] => [latlng.lat, latlng.lng];
    map.on('mousemove', (event) => handlers.onhover(at(event)));
    map.on('mouseout', () => handlers.onhover(null));
    map.getContainer().addEventListener('pointerleave', () => handlers.onhover(null));
    map.on('click', (event) => handlers.onclick(at(event)));
    map.on('contextmenu', (event) => handlers.onask(at(event)));
    map.on('dblclick', () => this.fit());
    map.on('movestart zoomstart', () => (this.#isFollowing = this.#isFitting));
    map.on('moveend zoomend', () => this.#robots.turnNames());
    map.on('move zoom viewreset resize', () => this.#tell(handlers));
    map.doubleClickZoom.disable();
  }

  #tell(handlers: MapHandlers): void {
    const map = this.#map;
    const size = map.getSize();
    const bounds = map.getBounds();
    handlers.onview({
      perM: map.getZoomScale(map.getZoom(), 0),
      width: size.x,
      height: size.y,
      top: bounds.getNorth(),
      left: bounds.getWest(),
    });
  }

  /** Show what was asked for, and go on to do so as that changes. */
  fit(): void {
    this.#isFollowing = true;
    this.#isFitting = true;
    this.#map.invalidateSize(false);
    this.#map.fitBounds(this.#sight, { padding: [26, 18], animate: false });
    this.#isFitting = false;
    this.#robots.turnNames();
  }

  /** The room has another size: the sight stays if somebody chose it. */
  resize(): void {
    if (this.#isFollowing) this.fit();
    else this.#map.invalidateSize(false);
  }

  zoom(steps: number): void {
    this.#map.setZoom(this.#map.getZoom() + steps);
  }

  /** What is to be in sight; the whole water for `null`. */
  showSight(sight: Sight | null): void {
    this.#sight = sight
      ? L.latLngBounds(
          [sight.north - sight.tall / 2, sight.east - sight.wide / 2],
          [sight.north + sight.tall / 2, sight.east + sight.wide / 2],
        )
      : this.#water;
    if (this.#isFollowing) this.fit();
  }

  showDesign(picture: DesignPicture | null, handlers: DesignHandlers | null): void {
    this.#design.show(picture, handlers);
  }

  remove(): void {
    this.#design.show(null, null);
    this.#base.remove();
    // Leaflet tells of a change of size up to 200 ms later, also of a map that is gone by then.
    this.#map.off('moveend');
    this.#map.remove();
  }

  /** Leave out some layers, and show all others. */
  hide(hidden: ReadonlySet<LayerKey>): void {
    for (const [key, group] of Object.entries(this.#groups)) {
      if (hidden.has(key as LayerKey)) group.remove();
      else group.addTo(this.#map);
    }
  }

  showBase(base: BaseMap | null): void {
    this.#base.show(base);
    this.#map.getContainer().classList.toggle('map-based', base !== null);
  }

  /** Shade the floor between two colours, each of red, green and blue, and draw its isobaths. */
  showDepth(shallow: readonly number[], deep: readonly number[]): void {
    drawDepth(this.#groups.depth, this.#site, shallow, deep);
  }

  showField(level: FieldLevel | null): void {
    drawField(this.#groups.field, level);
  }

  showPlaces(places: readonly MapPlace[]): void {
    const layer = this.#groups.places.clearLayers();
    for (const { name, kind, at } of places) {
      const text = `${kind === 'landmark' ? '' : `${kind}: `}${name}`;
      L.circleMarker([at[0], at[1]], { radius: 5, className: `map-place map-place-${kind}` })
        .bindTooltip(text, { direction: 'top', offset: [0, -4] })
        .addTo(layer);
    }
  }

  showSketches(shapes: readonly MapShape[]): void {
    drawShapes(this.#sketches, shapes);
  }

  /** What an operator laid over the map, such as other vessels. */
  showOthers(shapes: readonly MapShape[]): void {
    drawShapes(this.#groups.others, shapes);
  }

  showRobots(robots: readonly MapRobot[]): void {
    this.#robots.show(robots);
  }

  showPredicted(marks: readonly PredictedMark[]): void {
    this.#silent.show(marks);
  }

  /** Where cameras saw robots. */
  showSeen(marks: readonly PredictedMark[]): void {
    this.#seen.show(marks);
  }

  showTracks(tracks: readonly Track[]): void {
    this.#groups.track.clearLayers();
    for (const run of tracks.flatMap(fidelityRuns)) {
      L.polyline(run.points, {
        className: `map-track map-fidelity-${run.level ?? 'none'}`,
        interactive: false,
      }).addTo(this.#groups.track);
    }
  }

  /**
   * Plans by primitive, dashed: predicted, wherever the plan is; solid is what was flown.
   *
   * Where a track is expected it is drawn so, and the legs are a thin line beside it.
   */
  showPlans(plans: readonly (readonly Leg[])[], expected: readonly ExpectedWay[]): void {
    const plan = this.#groups.plan.clearLayers();
    this.#expected.clearLayers();
    const legs = plans.flat().map((leg) => ({ kind: leg.kind, points: legPoints(leg) }));
    const flat = ({ points }: ExpectedWay) =>
      points.map(([north, east]): [number, number] => [north, east]);
    if (expected.length > 0) {
      for (const leg of legs) {
        L.polyline(flat(leg), { className: 'map-straight', interactive: false }).addTo(plan);
      }
    }
    for (const way of expected.length > 0 ? expected : legs) {
      L.polyline(flat(way), { className: `map-leg map-${way.kind}` })
        .bindTooltip(PRIMITIVES[way.kind].title, { sticky: true })
        .addTo(expected.length > 0 ? this.#expected : plan);
    }
    for (const { start_ned: start } of plans.flatMap(([first]) => first ?? [])) {
      L.circleMarker([start[0], start[1]], { radius: 4, className: 'map-start' })
        .bindTooltip('Start of the plan')
        .addTo(plan);
    }
  }

  /** Where most flights of a plan’s rehearsal were, and where they came up. */
  showBand(shape: BandShape | null): void {
    drawBand(this.#groups.band, shape, 'band', this.#bands);
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
    this.#groups.flow.clearLayers();
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
      }).addTo(this.#groups.flow);
      for (const line of arrowLines(arrow, scale)) {
        L.polyline(plain(line), { className: `map-flow${manner}`, interactive: false }).addTo(
          this.#groups.flow,
        );
      }
      // A shaft of two pixels cannot be pointed at or tapped: its surroundings answer for it.
      L.circle([north + tip[0] / 2, east + tip[1] / 2], {
        radius: 0.4 * flow.spacing_m,
        className: 'map-flow-touch',
      })
        .bindTooltip(flowText(arrow), { sticky: true })
        .addTo(this.#groups.flow);
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

  showSurveyed(area: Area | null): void {
    this.#surveyed.clearLayers();
    if (area === null) return;
    L.polygon(plain(area.corners_m), { interactive: false, className: 'map-domain' }).addTo(
      this.#surveyed,
    );
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
}
