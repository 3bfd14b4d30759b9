import * as L from 'leaflet';
import { ellipseLine } from './flow_arrow';
import type { PredictedMark } from './predicted';

const LABEL_GAP_PX = 10;

/** Draw where robots that are not heard should be: the way, the 90 % ellipse and a hollow mark. */
export function drawPredicted(group: L.LayerGroup, marks: readonly PredictedMark[]): void {
  group.clearLayers();
  for (const { way, at, ellipseM, ellipseRad, label } of marks) {
    L.polyline(
      way.map(([north, east]): [number, number] => [north, east]),
      { className: 'map-predicted-way', interactive: false },
    ).addTo(group);
    const outline = ellipseLine(at[0], at[1], [ellipseM[0], ellipseM[1]], ellipseRad);
    L.polygon(
      outline.map(([north, east]): [number, number] => [north, east]),
      { className: 'map-predicted-ellipse', interactive: false },
    ).addTo(group);
    L.circleMarker([at[0], at[1]], { radius: 6, className: 'map-predicted-place' })
      .bindTooltip(label, {
        permanent: true,
        direction: 'bottom',
        offset: [0, LABEL_GAP_PX],
        className: 'map-name map-predicted-name',
      })
      .addTo(group);
  }
}
