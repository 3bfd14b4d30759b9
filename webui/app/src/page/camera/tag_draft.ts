import type { FieldError } from '../../api/problem';
import type { CameraTag, TagSetBody } from '../../api/types';
import { parseNumber } from '../../form/check';
import { plainNumber } from '../../text/unit';

/** The columns of a table of tags, in the order in which they are typed. */
export const COLUMNS = [
  { key: 'id', title: 'Id', unit: '', path: 'id' },
  { key: 'size', title: 'Black square', unit: 'm', path: 'size_m' },
  { key: 'x', title: 'North', unit: 'm', path: 'position_m.0', onRobot: 'Forward' },
  { key: 'y', title: 'East', unit: 'm', path: 'position_m.1', onRobot: 'Starboard' },
  { key: 'z', title: 'Down', unit: 'm', path: 'position_m.2' },
  { key: 'roll', title: 'Roll', unit: '°', path: 'roll_deg' },
  { key: 'pitch', title: 'Pitch', unit: '°', path: 'pitch_deg' },
  { key: 'heading', title: 'Heading', unit: '°', path: 'heading_deg' },
  { key: 'placeStd', title: 'Place ±', unit: 'm', path: 'position_std_m' },
  { key: 'angleStd', title: 'Angles ±', unit: '°', path: 'angle_std_deg' },
] as const satisfies readonly {
  key: string;
  title: string;
  unit: string;
  path: string;
  onRobot?: string;
}[];

export type ColumnKey = (typeof COLUMNS)[number]['key'];
/** A tag as it is typed, with a key of its own so that its row stays the same row. */
export type TagRow = Record<ColumnKey, string> & { key: number };

export interface TagSetDraft {
  layout: TagRow[];
  bundles: { robot: string; tags: TagRow[] }[];
}

let rows = 0;

/** Ids of tags in the tank begin here, those of robots at 0; three belong to one robot. */
export const FIRST_OF_TANK = 100;
const IDS_A_ROBOT = 3;

function rowOf(tag: CameraTag): TagRow {
  const text = (value: number | null | undefined) =>
    value === null || value === undefined ? '' : plainNumber(value);
  return {
    key: rows++,
    id: String(tag.id),
    size: text(tag.size_m),
    x: text(tag.position_m[0]),
    y: text(tag.position_m[1]),
    z: text(tag.position_m[2]),
    roll: text(tag.roll_deg ?? 0),
    pitch: text(tag.pitch_deg ?? 0),
    heading: text(tag.heading_deg ?? 0),
    placeStd: text(tag.position_std_m),
    angleStd: text(tag.angle_std_deg),
  };
}

/** Tables as they begin. */
export function draftOf(body: TagSetBody): TagSetDraft {
  return {
    layout: body.layout.tags.map(rowOf),
    bundles: body.bundles.map(({ robot, tags }) => ({ robot, tags: tags.map(rowOf) })),
  };
}

/** A further row: the next free id, and the size of the one before. */
export function nextRow(tags: readonly TagRow[], first: number): TagRow {
  const taken = tags.map(({ id }) => parseNumber(id));
  let id = first;
  while (taken.includes(id)) id++;
  const size = tags.at(-1)?.size ?? (first >= FIRST_OF_TANK ? '0.12' : '0.1');
  const none = { x: '', y: '', z: '', roll: '0', pitch: '0', heading: '0' };
  return { key: rows++, id: String(id), size, ...none, placeStd: '', angleStd: '' };
}

/** The first id of three that no robot has. */
export function freeIds(bundles: TagSetDraft['bundles']): number {
  const taken = bundles.flatMap(({ tags }) => tags.map(({ id }) => parseNumber(id) ?? 0));
  let first = 0;
  while (taken.some((id) => Math.floor(id / IDS_A_ROBOT) * IDS_A_ROBOT === first)) {
    first += IDS_A_ROBOT;
  }
  return first;
}

/** Where a robot of the manual's drawing carries its three tags. */
export function usualBundle(robot: string, first: number): TagSetDraft['bundles'][number] {
  const top = { size_m: 0.1, position_m: [0.02, 0, -0.085] as [number, number, number] };
  const side = (y: number) => ({
    size_m: 0.08,
    position_m: [-0.1, y, -0.06] as [number, number, number],
    roll_deg: 45 * Math.sign(y),
  });
  const tags = [top, side(-0.09), side(0.09)].map((tag, i) => ({ id: first + i, ...tag }));
  return { robot, tags: tags.map((tag) => rowOf(tag as CameraTag)) };
}

/** What the station is asked to keep, or what is no number, by its path in that document. */
export function bodyOf(draft: TagSetDraft): {
  body: TagSetBody;
  faults: Record<string, string>;
} {
  const faults: Record<string, string> = {};
  const tagOf = (row: TagRow, path: string): CameraTag => {
    const number = (key: ColumnKey): number => {
      const value = parseNumber(row[key]);
      const field = COLUMNS.find((column) => column.key === key)?.path ?? key;
      if (value === null) faults[`${path}.${field}`] = row[key].trim() ? 'No number.' : 'Missing.';
      return value ?? 0;
    };
    const maybe = (key: ColumnKey) => (row[key].trim() === '' ? null : number(key));
    return {
      id: number('id'),
      size_m: number('size'),
      position_m: [number('x'), number('y'), number('z')],
      roll_deg: number('roll'),
      pitch_deg: number('pitch'),
      heading_deg: number('heading'),
      position_std_m: maybe('placeStd'),
      angle_std_deg: maybe('angleStd'),
    };
  };
  const body = {
    layout: { tags: draft.layout.map((row, i) => tagOf(row, `layout.tags.${i}`)) },
    bundles: draft.bundles.map(({ robot, tags }, k) => ({
      robot,
      tags: tags.map((row, i) => tagOf(row, `bundles.${k}.tags.${i}`)),
    })),
  };
  return { body, faults };
}

/** Addresses of the sheets to print, one for each size of plates. */
export function sheetsOf(tags: readonly TagRow[]): { path: string; title: string }[] {
  const ids = new Map<number, number[]>();
  for (const tag of tags) {
    const [id, size] = [parseNumber(tag.id), parseNumber(tag.size)];
    if (id !== null && size !== null) ids.set(size, [...(ids.get(size) ?? []), id]);
  }
  return [...ids].map(([size, all]) => ({
    path: `/api/tags/sheets.pdf?ids=${all.join(',')}&size_m=${size}`,
    title: `Print ${all.length === 1 ? 'the plate' : `${all.length} plates`} of ${plainNumber(1000 * size)} mm`,
  }));
}

/** Refusals of the station by path; those that belong to no cell are told beside the button. */
export function faultsByPath(errors: readonly FieldError[]): Record<string, string> {
  return Object.fromEntries(errors.map(({ path, message }) => [path.join('.'), message]));
}

/** What a cell is told, its list of numbers included. */
export function cellFault(
  faults: Readonly<Record<string, string>>,
  row: string,
  column: string,
): string {
  const whole = column.startsWith('position_m.') ? faults[`${row}.position_m`] : undefined;
  return faults[`${row}.${column}`] ?? whole ?? '';
}

/** A file with tags: all of a site, those of a tank, or those of one robot. */
export function readFile(text: string, draft: TagSetDraft): TagSetDraft {
  const told: unknown = JSON.parse(text);
  if (!isRecord(told)) throw new Error('The file holds no object.');
  if ('layout' in told) {
    const { layout, bundles } = told;
    const robots = Array.isArray(bundles) ? bundles.map(bundleOf) : [];
    return { layout: rowsOf(layout), bundles: robots };
  }
  if ('robot' in told) {
    const bundle = bundleOf(told);
    const others = draft.bundles.filter(({ robot }) => robot !== bundle.robot);
    return { layout: draft.layout, bundles: [...others, bundle] };
  }
  return { layout: rowsOf(told), bundles: draft.bundles };
}

function bundleOf(told: unknown): TagSetDraft['bundles'][number] {
  if (!isRecord(told) || typeof told.robot !== 'string') throw new Error('robot: is no name.');
  return { robot: told.robot, tags: rowsOf(told) };
}

function rowsOf(told: unknown): TagRow[] {
  const tags = isRecord(told) ? told.tags : null;
  if (!Array.isArray(tags)) throw new Error('tags: is no list.');
  return tags.map((tag: unknown, i) => {
    if (!isRecord(tag) || typeof tag.id !== 'number' || !Array.isArray(tag.position_m)) {
      throw new Error(`tags ${i}: has no id or no position_m.`);
    }
    return rowOf(tag as CameraTag);
  });
}

function isRecord(value: unknown): value is Record<string, unknown> {
  return typeof value === 'object' && value !== null && !Array.isArray(value);
}
