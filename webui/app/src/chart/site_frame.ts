import * as L from 'leaflet';
import type { Area, Box, Site } from '../api/types';
import type { Line } from './flow_arrow';

export function boundsOf(box: Box): L.LatLngBounds {
  return L.latLngBounds([box.x_min_m, box.y_min_m], [box.x_max_m, box.y_max_m]);
}

/** The water itself under everything, its shore and the domain of surveys over the pictures. */
export function drawFrame(map: L.Map, site: Site): void {
  const still = { interactive: false };
  const below = { ...still, pane: 'water', renderer: L.svg({ pane: 'water' }) };
  const land = site.shoreline ? ' map-land' : '';
  const className = `map-water map-${site.kind}${land}`;
  L.rectangle(boundsOf(site.water), { ...below, className }).addTo(map);
  if (site.shoreline) {
    const shore = site.shoreline.corners_m.map(([north, east]): [number, number] => [north, east]);
    L.polygon(shore, { ...below, className: 'map-lake-floor' }).addTo(map);
    L.polygon(shore, { ...still, className: 'map-shore' }).addTo(map);
  }
  for (const island of site.islands) {
    L.polygon(plain(island.corners_m), { className: 'map-island' })
      .bindTooltip(`Island: ${island.name}`, { sticky: true })
      .addTo(map);
  }
  for (const area of site.keep_outs) {
    L.polygon(plain(area.corners_m), { className: 'map-keep-out' })
      .bindTooltip(`Keep out: ${area.name}`, { sticky: true })
      .addTo(map);
  }
  L.rectangle(boundsOf(site.domain), { ...still, className: 'map-domain' }).addTo(map);
}

export function plain(line: Line | Area['corners_m']): [number, number][] {
  return line.map(([north, east]): [number, number] => [north, east]);
}
