import * as L from 'leaflet';
import type { BandShape } from './flight_band';
import { plain } from './site_frame';

/** Draws bands below plans and above pictures; one for each map. */
export function bandRenderer(pane: string): L.Renderer {
  return L.svg({ pane });
}

/** Draw where most flights of a rehearsal were, as one area, and where they came up. */
export function drawBand(
  layer: L.LayerGroup,
  shape: BandShape | null,
  pane: string,
  renderer: L.Renderer,
): void {
  layer.clearLayers();
  if (!shape) return;
  // One path, so that pieces that overlap are not darker than the others.
  L.polygon(
    shape.pieces.map((piece) => [plain(piece)]),
    { pane, renderer, className: 'map-band', fillRule: 'nonzero', interactive: false },
  ).addTo(layer);
  for (const { outline, text } of shape.surfacings) {
    L.polygon(plain(outline), { pane, renderer, className: 'map-band-surfacing' })
      .bindTooltip(text, { sticky: true })
      .addTo(layer);
  }
}
