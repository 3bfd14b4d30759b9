import type { Area, Box, Json } from '../../api/types';
import { nodeAt, type Draft } from '../../form/draft.svelte';
import type { FormNode } from '../../form/schema';
import { areasOf, surveyedOf } from './config';

const UNDO_STEPS = 50;
const LEAST_CORNERS = 3;

/** Keep-outs of a planner's draft being drawn, moved, named and taken away; every step undone. */
export class KeepOutEditor {
  /** Area that is worked on. */
  selected = $state<number | null>(null);
  /** Corners clicked so far of one that is being drawn; `null` while none is. */
  drawing = $state.raw<readonly [number, number][] | null>(null);
  #past = $state.raw<readonly (readonly Area[])[]>([]);
  readonly #draft: () => Draft | null;

  constructor(draft: () => Draft | null) {
    this.#draft = draft;
  }

  readonly #node = $derived.by((): FormNode | null => {
    const members = this.#draft()?.tree.members ?? [];
    return members.find(({ path }) => path[0] === 'keep_outs') ?? null;
  });

  /** Whether this station's planner knows keep-outs. */
  readonly isKnown = $derived(this.#node !== null);
  readonly areas = $derived.by(() => areasOf(this.#draft()?.value));
  /** The polygon that the survey is confined to; `null` for all of the domain. */
  readonly surveyed = $derived.by(() => surveyedOf(this.#draft()?.value));
  readonly canUndo = $derived(this.#past.length > 0);
  /** What the station refused of them. */
  readonly error = $derived.by(() => {
    const draft = this.#draft();
    return draft && this.#node ? draft.error(this.#node) : null;
  });

  begin(): void {
    this.selected = null;
    this.drawing = [];
  }

  /** A click on the map: the next corner; a click on the first corner closes the area. */
  click(north: number, east: number): void {
    if (this.drawing) this.drawing = [...this.drawing, rounded(north, east)];
  }

  takeBack(): void {
    if (this.drawing) this.drawing = this.drawing.slice(0, -1);
  }

  finish(): void {
    const corners = this.drawing;
    this.drawing = null;
    if (corners && corners.length >= LEAST_CORNERS) this.#append([...corners]);
  }

  cancel(): void {
    this.drawing = null;
  }

  readonly canFinish = $derived((this.drawing?.length ?? 0) >= LEAST_CORNERS);

  /** An area in the middle of the domain, to be moved by its numbers: needs no pointer. */
  addInTheMiddle({ x_min_m, x_max_m, y_min_m, y_max_m }: Box): void {
    const [north, east] = [(x_min_m + x_max_m) / 2, (y_min_m + y_max_m) / 2];
    const [tall, wide] = [(x_max_m - x_min_m) / 16, (y_max_m - y_min_m) / 16];
    this.#append([
      rounded(north - tall, east - wide),
      rounded(north + tall, east - wide),
      rounded(north + tall, east + wide),
      rounded(north - tall, east + wide),
    ]);
  }

  rename(index: number, name: string): void {
    this.#change(index, (area) => ({ ...area, name }));
  }

  move(index: number, corner: number, north: number, east: number): void {
    this.#change(index, (area) => ({
      ...area,
      corners_m: area.corners_m.map((at, i) => (i === corner ? rounded(north, east) : at)),
    }));
  }

  /** A corner halfway to the next one. */
  insertAfter(index: number, corner: number): void {
    this.#change(index, (area) => {
      const [n0, e0] = area.corners_m[corner] ?? [0, 0];
      const [n1, e1] = area.corners_m[(corner + 1) % area.corners_m.length] ?? [n0, e0];
      const middle = rounded((n0 + n1) / 2, (e0 + e1) / 2);
      return { ...area, corners_m: area.corners_m.toSpliced(corner + 1, 0, middle) };
    });
  }

  removeCorner(index: number, corner: number): void {
    this.#change(index, (area) =>
      area.corners_m.length <= LEAST_CORNERS
        ? area
        : { ...area, corners_m: area.corners_m.toSpliced(corner, 1) },
    );
  }

  remove(index: number): void {
    this.#set(this.areas.toSpliced(index, 1));
    this.selected = null;
  }

  /** Make a drawn area the one that is surveyed, and the domain the box around it. */
  surveyInside(index: number): void {
    const area = this.areas[index];
    const draft = this.#draft();
    if (!area || !draft) return;
    const [norths, easts] = [0, 1].map((axis) => area.corners_m.map((at) => at[axis] ?? 0));
    this.#put('area', { ...area, name: surveyName(area.name) } as unknown as Json);
    for (const [member, value] of [
      ['x_min_m', Math.min(...(norths ?? []))],
      ['x_max_m', Math.max(...(norths ?? []))],
      ['y_min_m', Math.min(...(easts ?? []))],
      ['y_max_m', Math.max(...(easts ?? []))],
    ] as const) {
      this.#put(`domain.${member}`, value);
    }
    this.remove(index);
  }

  /** Survey the whole domain again; the box stays as it is. */
  surveyAll(): void {
    this.#put('area', null);
  }

  undo(): void {
    const before = this.#past.at(-1);
    if (!before) return;
    this.#past = this.#past.slice(0, -1);
    this.#write(before);
    if ((this.selected ?? 0) >= before.length) this.selected = null;
  }

  #append(corners_m: [number, number][]): void {
    const isTaken = (wanted: string) => this.areas.some(({ name }) => name === wanted);
    let number = this.areas.length + 1;
    while (isTaken(`Keep-out ${number}`)) number++;
    this.#set([...this.areas, { name: `Keep-out ${number}`, corners_m }]);
    this.selected = this.areas.length - 1;
  }

  #change(index: number, change: (area: Area) => Area): void {
    this.#set(this.areas.map((area, i) => (i === index ? change(area) : area)));
  }

  #set(areas: readonly Area[]): void {
    this.#past = [...this.#past, this.areas].slice(-UNDO_STEPS);
    this.#write(areas);
  }

  #put(path: string, value: Json): void {
    const draft = this.#draft();
    const node = draft ? nodeAt(draft.tree, path.split('.')) : null;
    if (draft && node) draft.set(node, value);
  }

  #write(areas: readonly Area[]): void {
    const draft = this.#draft();
    if (draft && this.#node) draft.set(this.#node, areas as unknown as Json);
  }
}

/** What was drawn as a keep-out is none any more; a name that somebody gave stays. */
function surveyName(name: string): string {
  return /^Keep-out \d+$/.test(name) ? 'Survey area' : name;
}

/** To the centimetre, which is finer than anybody knows a mooring. */
function rounded(north: number, east: number): [number, number] {
  return [Math.round(north * 100) / 100, Math.round(east * 100) / 100];
}
