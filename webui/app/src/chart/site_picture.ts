import * as L from 'leaflet';
import type { Site } from '../api/types';
import { fixed } from '../text/unit';
import { colourTable, tableIndex, type ColourMapName } from './colour_map';
import { depthGrid, isobaths } from './depth_shade';
import { extent, type Slice } from './slice';

/** A level of a field map, laid over the water. */
export interface FieldLevel {
  slice: Slice;
  range: readonly [number, number];
  colours: ColourMapName;
}

/** Points of the floor either way that its shading and its lines are made of. */
const SHADE_POINTS = 640;
const ISOBATH_POINTS = 128;
const DEPTH_ALPHA = 230;
/** Shade the floor between two colours, each of red, green and blue, and draw its isobaths. */
export function drawDepth(
  layer: L.LayerGroup,
  { bathymetry: floor, shoreline }: Pick<Site, 'bathymetry' | 'shoreline'>,
  shallow: readonly number[],
  deep: readonly number[],
): void {
  layer.clearLayers();
  if (!floor) return;
  const grid = depthGrid(floor, SHADE_POINTS);
  const shade = picture(grid.width, grid.height, (i) => {
    const depth = grid.values[i] ?? 0;
    if (depth <= 0) return null;
    const share = Math.sqrt(depth / grid.deepest);
    const mix = (c: 0 | 1 | 2) => (shallow[c] ?? 0) * (1 - share) + (deep[c] ?? 0) * share;
    return [mix(0), mix(1), mix(2), DEPTH_ALPHA];
  });
  // The outermost points of the grid stand on its edges: half a cell more than the floor.
  const half = (ends: readonly [number, number], count: number) =>
    (ends[1] - ends[0]) / (count - 1) / 2;
  const [up, across] = [half(grid.north, grid.height), half(grid.east, grid.width)];
  const bounds = L.latLngBounds(
    [grid.north[0] - up, grid.east[0] - across],
    [grid.north[1] + up, grid.east[1] + across],
  );
  if (shoreline) keepInside(shade, bounds, shoreline.corners_m);
  overlay(shade, bounds, 'depth').addTo(layer);
  for (const line of isobaths(depthGrid(floor, ISOBATH_POINTS))) {
    L.polyline(line.pieces, { className: 'map-isobath', interactive: false }).addTo(layer);
    for (const at of line.labels) {
      const text = `${fixed(line.depthM, line.depthM < 1 ? 1 : 0)} m`;
      const icon = L.divIcon({ html: text, className: 'map-isobath-text', iconSize: [0, 0] });
      L.marker(at, { icon, interactive: false, keyboard: false }).addTo(layer);
    }
  }
}

export function drawField(layer: L.LayerGroup, level: FieldLevel | null): void {
  layer.clearLayers();
  if (!level) return;
  const { slice, range, colours } = level;
  const table = colourTable(colours);
  const image = picture(slice.width, slice.height, (i) => {
    const value = slice.values[i] ?? NaN;
    if (!Number.isFinite(value)) return null;
    const from = tableIndex(value, range[0], range[1]) * 3;
    return [table[from] ?? 0, table[from + 1] ?? 0, table[from + 2] ?? 0, 255];
  });
  const [west, east] = extent(slice.across.values);
  const [north, south] = extent(slice.down.values);
  overlay(image, L.latLngBounds([south, west], [north, east]), 'field').addTo(layer);
}

/** A picture of one pixel a cell, row by row from the north-west; nothing where there is no colour. */
function picture(
  width: number,
  height: number,
  colourOf: (cell: number) => readonly [number, number, number, number] | null,
): HTMLCanvasElement {
  const canvas = document.createElement('canvas');
  canvas.width = width;
  canvas.height = height;
  const context = canvas.getContext('2d');
  if (!context) return canvas;
  const image = context.createImageData(width, height);
  for (let i = 0; i < width * height; i++) {
    const colour = colourOf(i);
    if (colour) image.data.set(colour, i * 4);
  }
  context.putImageData(image, 0, 0);
  return canvas;
}

/** A picture over a part of the site; Leaflet places any element that it is given. */
function overlay(canvas: HTMLCanvasElement, bounds: L.LatLngBounds, pane: string): L.Layer {
  return L.svgOverlay(canvas as unknown as SVGElement, bounds, { pane, className: 'map-picture' });
}

/** Clear what of a picture lies outside of an outline. */
function keepInside(
  canvas: HTMLCanvasElement,
  bounds: L.LatLngBounds,
  corners: readonly (readonly [number, number])[],
): void {
  const context = canvas.getContext('2d');
  if (!context) return;
  const across = canvas.width / (bounds.getEast() - bounds.getWest());
  const down = canvas.height / (bounds.getNorth() - bounds.getSouth());
  context.globalCompositeOperation = 'destination-in';
  context.beginPath();
  for (const [north, east] of corners) {
    context.lineTo((east - bounds.getWest()) * across, (bounds.getNorth() - north) * down);
  }
  context.fill();
}
