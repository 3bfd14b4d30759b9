/** Areas and marks of a plan file as parts of a water. */
import type { Water } from '../../api/types';
import type { PlanFile } from './plan_file';

export type WaterDocument = Water['document'];
type WaterPlace = WaterDocument['places'][number];
export type ReadArea = PlanFile['areas'][number];
export type ReadMark = PlanFile['marks'][number];

/** The longest name of an area or a place. */
const NAME_MAX = 60;

/** A name that no other of its kind has. */
function free(wanted: string, taken: readonly string[]): string {
  const title = wanted.trim().slice(0, NAME_MAX - 4) || 'imported';
  let [name, number] = [title, 1];
  while (taken.includes(name)) name = `${title} ${++number}`;
  return name;
}

/** What an area is called where the file gives it no name. */
export function titleOfArea({ name, number }: ReadArea): string {
  return name.trim() || `area ${number}`;
}

/** The water with an area that no plan may enter. */
export function withKeepOut(water: WaterDocument, area: ReadArea): WaterDocument {
  const name = free(
    titleOfArea(area),
    water.keep_outs.map((one) => one.name),
  );
  return { ...water, keep_outs: [...water.keep_outs, { name, corners_m: area.corners_m }] };
}

/**
 * The water with the box around an area as its domain, the part that surveys explore.
 *
 * Of the box only what lies in the water counts; `null` where nothing of it does.
 */
export function withDomain(water: WaterDocument, { corners_m }: ReadArea): WaterDocument | null {
  const { water: box } = water;
  const north = corners_m.map(([one]) => one);
  const east = corners_m.map(([, one]) => one);
  const domain = {
    ...water.domain,
    x_min_m: Math.max(box.x_min_m, Math.min(...north)),
    x_max_m: Math.min(box.x_max_m, Math.max(...north)),
    y_min_m: Math.max(box.y_min_m, Math.min(...east)),
    y_max_m: Math.min(box.y_max_m, Math.max(...east)),
  };
  const isSome = domain.x_max_m > domain.x_min_m && domain.y_max_m > domain.y_min_m;
  return isSome ? { ...water, domain } : null;
}

/** The water with a mark as one of its places. */
export function withPlace(water: WaterDocument, mark: ReadMark): WaterDocument {
  const name = free(
    mark.name || mark.kind,
    water.places.map((one) => one.name),
  );
  const [north_m, east_m] = mark.place_m;
  // By its place in the water alone: that of the file is another one where the file was moved.
  const place = { name, kind: 'landmark', north_m, east_m, depth_m: 0 } as WaterPlace;
  return { ...water, places: [...water.places, place] };
}
