import type { Grip } from '../../chart/spot_gesture';
import { placed, ruleOf, spotsOf, type Design, type Spot, type Waypoint } from './document';
import type { Keeper } from './keeper.svelte';
import {
  at,
  chosenOf,
  copied,
  inserted,
  middleOf,
  moved,
  naming,
  reordered,
  reversed,
  scaled,
  shifted,
  snapped,
  turned,
  without,
  type Edited,
  type Snap,
} from './spots';

export type Mode = 'move' | 'add' | 'choose';

/** What is dragged in the 3D view alone: the deep turn on the way to a place. */
type Held = Grip | { kind: 'depth'; index: number };

interface Drag {
  grip: Held;
  /** What it began with. */
  design: Design;
  spots: readonly Waypoint[];
  chosen: ReadonlySet<number>;
  from: Spot;
  what: string;
}

const NONE = chosenOf([]);
/** Depths are dragged by the centimetre. */
const CM = 0.01;

/** A design in the hands of a person: what is chosen of it, and what a pointer or a key does. */
export class DesignEditor {
  readonly keeper: Keeper;
  chosen = $state.raw<ReadonlySet<number>>(NONE);
  mode = $state<Mode>('move');
  snap = $state.raw<Snap>({ to: 'none' });
  /** While something is dragged: what it would be. */
  #dragged = $state.raw<Design | null>(null);
  #drag: Drag | null = null;
  readonly #mayEdit: () => boolean;

  constructor(keeper: Keeper, mayEdit: () => boolean) {
    this.keeper = keeper;
    this.#mayEdit = mayEdit;
    if (keeper.document.content.kind === 'waypoints' && this.spots.length === 0) this.mode = 'add';
  }

  /** As it is drawn: with what is being dragged. */
  readonly design = $derived.by(() => this.#dragged ?? this.keeper.document);
  readonly isDragging = $derived.by(() => this.#dragged !== null);
  readonly rule = $derived.by(() => ruleOf(this.design.content));
  readonly spots = $derived.by(() => spotsOf(this.design.content));
  readonly isEditable = $derived.by(() => this.#mayEdit() && this.keeper.conflict === null);
  /** The one chosen place, if it is one. */
  readonly only = $derived.by(() =>
    this.chosen.size === 1 ? ([...this.chosen][0] ?? null) : null,
  );

  choose(indexes: Iterable<number>, isMore = false): void {
    const wanted = [...indexes].filter((i) => i >= 0 && i < this.spots.length);
    this.chosen = chosenOf(isMore ? [...this.chosen, ...wanted] : wanted);
  }

  /** A place alone, or one more or one less of several. */
  pick(index: number, isMore: boolean): void {
    if (!isMore) this.choose([index]);
    else if (this.chosen.has(index)) this.choose([...this.chosen].filter((one) => one !== index));
    else this.choose([index], true);
  }

  chooseAll(): void {
    this.choose(this.spots.keys());
  }

  /** From the last chosen one to this. */
  chooseTo(index: number): void {
    const from = [...this.chosen].at(-1) ?? index;
    const [low, high] = [Math.min(from, index), Math.max(from, index)];
    this.choose(Array.from({ length: high - low + 1 }, (_, i) => low + i));
  }

  set(design: Design, what: string, joins = ''): void {
    if (this.isEditable) this.keeper.change(design, what, joins);
  }

  /** Change of the places of the design; what is chosen stays in reach. */
  #setSpots(spots: readonly Waypoint[], what: string, joins = ''): void {
    this.set(placed(this.keeper.document, spots), what, joins);
    this.choose(this.chosen);
  }

  #take({ spots, chosen }: Edited<Waypoint>, what: string): void {
    this.set(placed(this.keeper.document, spots), what);
    this.choose(chosen);
  }

  get #all(): readonly Waypoint[] {
    return spotsOf(this.keeper.document.content);
  }

  /** A click on free water. */
  water(north: number, east: number): void {
    if (this.mode !== 'add' || !this.isEditable) {
      this.chosen = NONE;
      return;
    }
    const spot = snapped({ north_m: north, east_m: east }, this.snap);
    if (this.rule.shape === 'place') this.place(0, spot);
    else this.add(spot);
  }

  /** One more place behind the chosen one, or at the end. */
  add(spot: Spot): void {
    if (this.#all.length >= this.rule.most) return;
    const behind =
      this.rule.shape === 'way' && this.only !== null ? this.only + 1 : this.#all.length;
    const index = Math.min(behind, this.#all.length);
    this.#take(inserted(this.#all, index, spot), `Added ${this.rule.noun} ${index + 1}`);
  }

  /** One more place in the middle of the leg behind one. */
  insertBehind(index: number): void {
    const [from, to] = [this.#all[index], this.#all[index + 1] ?? this.#all[0]];
    if (!from || !to || this.#all.length >= this.rule.most) return;
    const north_m = (from.north_m + to.north_m) / 2;
    const east_m = (from.east_m + to.east_m) / 2;
    const edited = inserted(this.#all, index + 1, { north_m, east_m });
    this.#take(edited, `Inserted ${this.rule.noun} ${index + 2}`);
  }

  place(index: number, { north_m, east_m }: Spot): void {
    const spots = this.#all.map((one, i) => (i === index ? at(one, north_m, east_m) : one));
    this.#setSpots(spots, naming('Moved', this.rule.noun, chosenOf([index])));
  }

  /** What is said of waypoints beside their place. */
  say(indexes: ReadonlySet<number>, saying: Partial<Waypoint>, what: string): void {
    const spots = this.#all.map((one, i) => (indexes.has(i) ? { ...one, ...saying } : one));
    this.#setSpots(spots, what);
  }

  nudge(north: number, east: number): void {
    if (this.chosen.size === 0) return;
    const what = naming('Nudged', this.rule.noun, this.chosen);
    const joins = `nudge ${[...this.chosen].join()}`;
    this.#setSpots(moved(this.#all, this.chosen, north, east), what, joins);
  }

  shift(north: number, east: number): void {
    const what = naming('Moved', this.rule.noun, this.#subject);
    this.#setSpots(moved(this.#all, this.#subject, north, east), what);
  }

  turn(rad: number): void {
    const about = middleOf(this.#all, this.#figure);
    const what = naming('Turned', this.rule.noun, this.#figure);
    this.#setSpots(turned(this.#all, this.#figure, rad, about), what);
  }

  scale(factor: number): void {
    const about = middleOf(this.#all, this.#figure);
    const what = naming('Scaled', this.rule.noun, this.#figure);
    this.#setSpots(scaled(this.#all, this.#figure, factor, about), what);
  }

  copy(north: number, east: number): void {
    if (this.#all.length + this.chosen.size > this.rule.most || this.chosen.size === 0) return;
    const what = naming('Copied', this.rule.noun, this.chosen);
    this.#take(copied(this.#all, this.chosen, north, east), what);
  }

  reverse(): void {
    this.#setSpots(
      reversed(this.#all, this.#subject),
      naming('Reversed', this.rule.noun, this.#subject),
    );
  }

  snapNow(): void {
    const spots = this.#all.map((one, i) => {
      if (!this.#subject.has(i)) return one;
      const { north_m, east_m } = snapped(one, this.snap);
      return at(one, north_m, east_m);
    });
    this.#setSpots(spots, naming('Snapped', this.rule.noun, this.#subject));
  }

  remove(): void {
    const what = naming('Deleted', this.rule.noun, this.chosen);
    const edited = this.canRemove ? without(this.#all, this.chosen, this.rule.least) : null;
    if (edited) this.#take(edited, what);
  }

  readonly canRemove = $derived.by(
    () => this.chosen.size > 0 && this.spots.length - this.chosen.size >= this.rule.least,
  );

  /** The chosen ones before the place that has a number now. */
  reorder(before: number): void {
    if (this.chosen.size === 0) return;
    const what = naming('Reordered', this.rule.noun, this.chosen);
    this.#take(reordered(this.#all, this.chosen, before), what);
  }

  reorderBy(step: 1 | -1): void {
    const what = naming('Reordered', this.rule.noun, this.chosen);
    this.#take(shifted(this.#all, this.chosen, step), what);
  }

  /** What is turned or scaled: one place alone has no direction and no size. */
  get #figure(): ReadonlySet<number> {
    return this.chosen.size > 1 ? this.chosen : chosenOf(this.#all.keys());
  }

  /** What is changed as a whole: the chosen ones, or all where none is chosen. */
  get #subject(): ReadonlySet<number> {
    return this.chosen.size > 0 ? this.chosen : chosenOf(this.#all.keys());
  }

  begin(grip: Grip, north: number, east: number): void {
    if (!this.isEditable) return;
    this.keeper.hold(true);
    const { document: design } = this.keeper;
    const from = { north_m: north, east_m: east };
    let spots = this.#all;
    let what = '';
    if (grip.kind === 'leg') {
      const behind = grip.index + 1;
      spots = inserted(spots, behind, from).spots;
      this.chosen = chosenOf([behind]);
      what = `Inserted ${this.rule.noun} ${behind + 1}`;
    } else if (grip.kind === 'spot') {
      if (!this.chosen.has(grip.index)) this.chosen = chosenOf([grip.index]);
      what = naming('Moved', this.rule.noun, this.chosen);
    } else if (grip.kind === 'radius') what = 'Changed the radius';
    else {
      what = naming(grip.kind === 'turn' ? 'Turned' : 'Scaled', this.rule.noun, this.chosen);
    }
    this.#drag = { grip, design, spots, chosen: this.chosen, from, what };
    if (grip.kind === 'leg') this.#dragged = placed(design, spots);
  }

  /** Take hold of a deep turn: that of the chosen waypoints, or of a design that is no way. */
  beginDepth(index: number): void {
    if (!this.isEditable) return;
    this.keeper.hold(true);
    const { document: design } = this.keeper;
    const isWay = this.rule.shape === 'way';
    if (isWay && !this.chosen.has(index)) this.chosen = chosenOf([index]);
    const from = { north_m: 0, east_m: 0 };
    const what = isWay
      ? `Deep turn of${naming('', this.rule.noun, this.chosen)}`
      : 'Deep turn changed';
    const grip = { kind: 'depth', index } as const;
    this.#drag = { grip, design, spots: this.#all, chosen: this.chosen, from, what };
  }

  dragDepth(depthM: number): void {
    if (this.#drag?.grip.kind !== 'depth') return;
    const { design, spots, chosen, what } = this.#drag;
    const deep_m = Math.max(CM, Math.round(depthM / CM) * CM);
    const told = Number(deep_m.toFixed(2));
    this.#dragged =
      this.rule.shape === 'way'
        ? placed(
            design,
            spots.map((one, i) => (chosen.has(i) ? { ...one, deep_m: told } : one)),
          )
        : { ...design, manner: { ...design.manner, deep_m: told } };
    this.keeper.preview(this.#dragged, what);
  }

  drag(north: number, east: number): void {
    if (!this.#drag) return;
    this.#dragged = dragged(this.#drag, { north_m: north, east_m: east }, this.snap);
    this.keeper.preview(this.#dragged, this.#drag.what);
  }

  end(isKept: boolean): void {
    const [drag, design] = [this.#drag, this.#dragged];
    this.#drag = this.#dragged = null;
    this.keeper.hold(false);
    if (drag && design && isKept) this.set(design, drag.what);
    if (!isKept) this.keeper.forgetPreview();
    this.choose(this.chosen);
  }

  undo(): void {
    this.keeper.undo();
    this.choose(this.chosen);
  }

  redo(): void {
    this.keeper.redo();
    this.choose(this.chosen);
  }
}

/** What a design is with the pointer at a place. */
function dragged({ grip, design, spots, chosen, from }: Drag, to: Spot, snap: Snap): Design {
  if (grip.kind === 'turn' || grip.kind === 'scale') {
    const about = middleOf(spots, chosen);
    const change = grip.kind === 'turn' ? turnOf(about, from, to) : scaleOf(about, from, to);
    const apply = grip.kind === 'turn' ? turned : scaled;
    return placed(design, apply(spots, chosen, change, about));
  }
  if (grip.kind === 'radius') return withRadius(design, spots, to);
  if (grip.kind === 'depth') return design;
  const index = grip.kind === 'leg' ? grip.index + 1 : grip.index;
  const held = spots[index];
  if (!held) return design;
  const target = snapped(
    grip.kind === 'leg'
      ? to
      : {
          north_m: held.north_m + to.north_m - from.north_m,
          east_m: held.east_m + to.east_m - from.east_m,
        },
    snap,
  );
  const [north, east] = [target.north_m - held.north_m, target.east_m - held.east_m];
  return placed(design, moved(spots, chosen, north, east));
}

function withRadius(design: Design, [centre]: readonly Spot[], to: Spot): Design {
  const { content } = design;
  if (!centre || !('radius_m' in content)) return design;
  const away = Math.hypot(to.north_m - centre.north_m, to.east_m - centre.east_m);
  const radius_m = Math.max(0.01, Math.round(away * 100) / 100);
  return { ...design, content: { ...content, radius_m } };
}

function turnOf(about: Spot, from: Spot, to: Spot): number {
  const angle = (spot: Spot) =>
    Math.atan2(spot.east_m - about.east_m, spot.north_m - about.north_m);
  return angle(to) - angle(from);
}

function scaleOf(about: Spot, from: Spot, to: Spot): number {
  const far = (spot: Spot) => Math.hypot(spot.north_m - about.north_m, spot.east_m - about.east_m);
  return far(from) > 0 ? Math.max(0.01, far(to) / far(from)) : 1;
}
