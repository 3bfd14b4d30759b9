/** What of a design and of the station's answer lies on the map. */
import type { DesignPicture } from '../../chart/site_design';
import type { NorthEast } from '../../api/types';
import type { Fault, Outline } from './account.svelte';
import type { DesignEditor } from './editor.svelte';
import type { SpotBox } from './spots';
import type { Sight } from '../../chart/target_view';

export type Faults = DesignPicture['faults'];

export const NO_FAULTS: Faults = { spots: new Set(), lines: [], places: [] };

/** Where faults are drawn; only the waypoints of a way are places of the document. */
export function faultsOf(outline: Outline | null, isWay: boolean, count: number): Faults {
  if (!outline || outline.violations.length === 0) return NO_FAULTS;
  const spots = new Set<number>();
  const lines: NorthEast[][] = [];
  const places: { at: NorthEast; text: string }[] = [];
  for (const fault of outline.violations) {
    const index = waypointOf(outline, fault);
    if (index !== null && isWay && count > 0) spots.add(index % count);
    const leg = outline.legs.find(({ number }) => number === fault.leg);
    if (leg) {
      lines.push([leg.start_ned, leg.end_ned].map(([north, east]) => [north, east] as const));
    }
    const [north, east] = fault.place_ned ?? [];
    if (north !== undefined && east !== undefined) {
      places.push({ at: [north, east], text: fault.message });
    }
  }
  return { spots, lines, places };
}

/** The waypoint, from 0, that a fault is at or leads to; `null` where it is at none. */
export function waypointOf(outline: Outline, fault: Fault): number | null {
  return fault.waypoint ?? outline.legs.find((one) => one.number === fault.leg)?.waypoint ?? null;
}

/** Where to look for a fault. */
export function sightOf(outline: Outline, fault: Fault): Pick<Sight, 'north' | 'east'> | null {
  const leg = outline.legs.find(({ number }) => number === fault.leg);
  const waypoint = outline.waypoints.find(({ number }) => number === fault.waypoint);
  const [north, east] = fault.place_ned ?? [];
  if (north !== undefined && east !== undefined) return { north, east };
  if (leg) {
    const [from, to] = [leg.start_ned, leg.end_ned];
    return { north: (from[0] + to[0]) / 2, east: (from[1] + to[1]) / 2 };
  }
  return waypoint ? { north: waypoint.north_m, east: waypoint.east_m } : null;
}

/** The way of a pattern, as the station laid it out. */
export function wayOf(outline: Outline | null): NorthEast[] {
  return (outline?.waypoints ?? []).map(({ north_m, east_m }) => [north_m, east_m] as const);
}

export function pictureOf(
  editor: DesignEditor,
  way: readonly NorthEast[],
  faults: Faults,
): DesignPicture {
  const { content } = editor.design;
  const { shape, most } = editor.rule;
  return {
    spots: editor.spots,
    shape,
    returns: content.kind === 'waypoints' && content.returns,
    chosen: editor.chosen,
    way: shape === 'way' ? [] : way,
    radiusM: 'radius_m' in content ? content.radius_m : null,
    faults,
    mode: editor.mode,
    isEditable: editor.isEditable,
    most,
  };
}

/** Enough room around a box of places. */
export function sightOfBox(box: SpotBox): Sight {
  const tall = Math.max(1, 1.4 * (box.north - box.south));
  const wide = Math.max(1, 1.4 * (box.east - box.west));
  return { north: (box.north + box.south) / 2, east: (box.east + box.west) / 2, tall, wide };
}
