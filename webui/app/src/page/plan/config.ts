import type { Area, Json, JsonObject } from '../../api/types';
import { isObject } from '../../form/schema';

function at(config: JsonObject | undefined, path: readonly string[]): Json | undefined {
  let found: Json | undefined = config;
  for (const key of path) found = isObject(found) ? found[key] : undefined;
  return found;
}

/** A number that a plan or survey was told; 0 where it was not. */
export function numberOf(config: JsonObject | undefined, ...path: string[]): number {
  const found = at(config, path);
  return typeof found === 'number' ? found : 0;
}

export function textOf(config: JsonObject | undefined, ...path: string[]): string {
  const found = at(config, path);
  return typeof found === 'string' ? found : '';
}

export function thresholdsOf(config: JsonObject | undefined): number[] {
  const found = config?.fidelity_thresholds_m;
  return Array.isArray(found) ? found.map(Number) : [];
}

/** The steady current that plans are made in. */
export function currentOf(config: JsonObject | undefined): { north: number; east: number } {
  if (textOf(config, 'current', 'source') === 'none') return { north: 0, east: 0 };
  return {
    north: numberOf(config, 'current', 'north_m_s'),
    east: numberOf(config, 'current', 'east_m_s'),
  };
}

/** Areas of a settings document; what is no polygon is left out. */
export function areasOf(config: JsonObject | undefined): Area[] {
  const found = config?.keep_outs;
  if (!Array.isArray(found)) return [];
  return found.flatMap((area) => areaOf(area) ?? []);
}

/** The polygon that a survey is confined to; `null` for all of the domain. */
export function surveyedOf(config: JsonObject | undefined): Area | null {
  return areaOf(config?.area);
}

function areaOf(area: Json | undefined): Area | null {
  if (!isObject(area)) return null;
  const { name, corners_m } = area;
  if (!Array.isArray(corners_m)) return null;
  const corners = corners_m
    .filter((corner) => Array.isArray(corner))
    .map(([north, east]): [number, number] => [Number(north), Number(east)]);
  return { name: typeof name === 'string' ? name : '', corners_m: corners };
}
