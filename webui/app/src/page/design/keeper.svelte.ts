import { newKey } from '../../api/call';
import { Problem, sentence } from '../../api/problem';
import { same, type Design, type DesignView } from './document';
import type { SafetyCopies } from './safety_copy';

/**
 * What the station does for one design; each call names the revision that it goes out from. One
 * that is repeated with the same key acts once and gets the first one's answer.
 */
export interface DesignStore {
  read: () => Promise<DesignView>;
  put: (revision: number, document: Design, what: string) => Promise<DesignView>;
  undo: (revision: number, key: string) => Promise<DesignView>;
  redo: (revision: number, key: string) => Promise<DesignView>;
  saveVersion: (revision: number, comment: string, key: string) => Promise<DesignView>;
  restore: (revision: number, version: number, key: string) => Promise<DesignView>;
  /** Keep a document as a design of its own; tells its name. */
  copy: (name: string, document: Design) => Promise<void>;
}

type Order =
  | { kind: 'put'; document: Design; what: string; joins: string }
  | { kind: 'undo' | 'redo'; key: string }
  | { kind: 'version'; comment: string; key: string }
  | { kind: 'restore'; version: number; key: string };

export type Keeping = 'kept' | 'keeping' | 'away' | 'refused' | 'conflict';

/** Somebody changed the design in between; `theirs` is what the station has now. */
export interface Conflict {
  theirs: DesignView;
  mine: Design;
}

const RETRY_MS = 2000;
const PAST_MAX = 50;
/** Between two safety copies of one drag. */
const PREVIEW_MS = 200;

/**
 * Keeps a design at the station as it is changed: one change after the other, none lost.
 *
 * The newest document is always the one on the screen. While the station is away the changes wait
 * and a copy lies in the browser; when somebody else was faster everything stops until a person
 * has said what is to be.
 */
export class Keeper {
  /** As the station has it. */
  view = $state.raw<DesignView>() as DesignView;
  /** As it is on the screen. */
  document = $state.raw<Design>() as Design;
  keeping = $state.raw<Keeping>('kept');
  /** Why it is not kept. */
  refusal = $state.raw('');
  errors = $state.raw<Problem['errors']>([]);
  /** Station time of the last change that is known to be kept. */
  keptAt = $state.raw('');
  conflict = $state.raw<Conflict | null>(null);
  /** The last change of somebody else that came onto the screen. */
  news = $state.raw<Pick<DesignView, 'changed_by' | 'changed_at' | 'what'> | null>(null);
  #orders: Order[] = $state.raw([]);
  #past = $state.raw<readonly Design[]>([]);
  #future = $state.raw<readonly Design[]>([]);
  #isRunning = false;
  #isHeld = false;
  #previewedMs = -Infinity;
  #wake: (() => void) | null = null;
  #settling: (() => void)[] = [];
  #isOver = false;
  readonly #store: DesignStore;
  readonly #copies: SafetyCopies;
  readonly #me: () => string;

  constructor(view: DesignView, store: DesignStore, copies: SafetyCopies, me: () => string) {
    this.view = view;
    this.document = view.document;
    this.keptAt = view.changed_at;
    this.#store = store;
    this.#copies = copies;
    this.#me = me;
  }

  /** What is waiting to be kept. */
  readonly waiting = $derived.by(() => this.#orders.length);
  readonly canUndo = $derived.by(() => this.#past.length > 0 || this.view.undo.length > 0);
  readonly canRedo = $derived.by(() => this.#future.length > 0 || this.view.redo.length > 0);

  /** Take a change. One that `joins` the change before it, not sent yet, takes its place. */
  change(document: Design, what: string, joins = ''): void {
    if (this.conflict || same(document, this.document)) return;
    this.#past = [...this.#past, this.document].slice(-PAST_MAX);
    this.#future = [];
    this.document = document;
    this.#copies.keep(this.view, document, what);
    const last = this.#orders.at(-1);
    const isJoined = joins !== '' && last?.kind === 'put' && last.joins === joins;
    // The first one may be under way.
    const rest = isJoined && this.#orders.length > 1 ? this.#orders.slice(0, -1) : this.#orders;
    this.#give([...rest, { kind: 'put', document, what, joins }]);
  }

  /** A change that is not finished, such as a drag: on the screen and in the safety copy only. */
  preview(document: Design, what: string): void {
    const nowMs = performance.now();
    if (nowMs - this.#previewedMs < PREVIEW_MS) return;
    this.#previewedMs = nowMs;
    this.#copies.keep(this.view, document, what);
  }

  forgetPreview(): void {
    if (this.#orders.length === 0) this.#copies.forget(this.view.id);
    else this.#copies.keep(this.view, this.document, '');
  }

  /** Whether what comes from elsewhere has to wait, because something is being dragged. */
  hold(isHeld: boolean): void {
    this.#isHeld = isHeld;
  }

  undo(): void {
    if (!this.canUndo || this.conflict) return;
    const before = this.#past.at(-1);
    if (before) {
      this.#past = this.#past.slice(0, -1);
      this.#future = [...this.#future, this.document];
      this.#show(before);
    }
    this.#give([...this.#orders, { kind: 'undo', key: newKey() }]);
  }

  redo(): void {
    if (!this.canRedo || this.conflict) return;
    const after = this.#future.at(-1);
    if (after) {
      this.#future = this.#future.slice(0, -1);
      this.#past = [...this.#past, this.document];
      this.#show(after);
    }
    this.#give([...this.#orders, { kind: 'redo', key: newKey() }]);
  }

  saveVersion(comment: string): void {
    this.#give([...this.#orders, { kind: 'version', comment, key: newKey() }]);
  }

  restore(version: number): void {
    this.#past = this.#future = [];
    this.#give([...this.#orders, { kind: 'restore', version, key: newKey() }]);
  }

  /** Everything that waits is kept, or nothing goes on; tells which. */
  async settled(): Promise<boolean> {
    while (this.#orders.length > 0 && this.keeping === 'keeping') {
      await new Promise<void>((go) => this.#settling.push(go));
    }
    return this.keeping === 'kept';
  }

  /** The station has something newer: take it, unless something of this page is not kept yet. */
  async look(): Promise<void> {
    if (this.#isBusy()) return;
    let view: DesignView;
    try {
      view = await this.#store.read();
    } catch {
      return;
    }
    if (this.#isBusy() || view.revision <= this.view.revision) return;
    const isOther = !same(view.document, this.document);
    this.#past = this.#future = [];
    this.#take(view);
    if (isOther) this.news = view;
  }

  #isBusy(): boolean {
    return this.#orders.length > 0 || this.#isHeld || this.conflict !== null;
  }

  /** What the other one made of it; mine is kept as a design of its own. */
  async takeTheirs(): Promise<void> {
    const { conflict } = this;
    if (!conflict) return;
    await this.#store.copy(copyName(this.view.name, this.#me()), conflict.mine);
    const theirs = await this.#store.read();
    this.#resolve(theirs);
    this.#take(theirs);
  }

  /** Mine over what the other one made, which stays as a version. */
  async putMine(): Promise<void> {
    const { conflict } = this;
    if (!conflict) return;
    const theirs = await this.#store.read();
    const about = `${theirs.changed_by}: ${theirs.what}`;
    const kept = await this.#store.saveVersion(theirs.revision, about.slice(0, 200), newKey());
    this.#resolve(kept);
    this.#past = [theirs.document];
    const what = `Put on top of a change by ${theirs.changed_by}`;
    this.#give([{ kind: 'put', document: conflict.mine, what, joins: '' }]);
  }

  /** Try again at once, for example because the network is back. */
  retry(): void {
    this.#wake?.();
  }

  stop(): void {
    this.#isOver = true;
    this.#wake?.();
  }

  #resolve(view: DesignView): void {
    this.conflict = null;
    this.view = view;
    this.#orders = [];
    this.#past = this.#future = [];
    this.keeping = 'kept';
    this.refusal = '';
  }

  #show(document: Design): void {
    this.document = document;
    this.#copies.keep(this.view, document, 'Undone or redone');
  }

  #give(orders: Order[]): void {
    this.#orders = orders;
    if (!this.#isRunning) void this.#run();
  }

  async #run(): Promise<void> {
    this.#isRunning = true;
    for (let [order] = this.#orders; order && !this.#isOver; [order] = this.#orders) {
      if (this.keeping !== 'away') this.keeping = 'keeping';
      try {
        const view = await this.#send(order);
        this.#done(view, this.#orders.slice(1));
      } catch (error) {
        if (isAway(error)) await this.#rest();
        else if (error instanceof Problem && error.status === 412) await this.#clash(order);
        else this.#refuse(error);
      }
      this.#tell();
      if (this.conflict) break;
    }
    this.#isRunning = false;
  }

  /** Let those who wait until it is settled look again. */
  #tell(): void {
    for (const go of this.#settling.splice(0)) go();
  }

  /** The station has what was ordered; `orders` are left. */
  #done(view: DesignView, orders: Order[]): void {
    this.#orders = orders;
    this.refusal = '';
    this.errors = [];
    if (orders.length === 0) this.#take(view);
    else this.view = view;
  }

  #send(order: Order): Promise<DesignView> {
    const { revision } = this.view;
    switch (order.kind) {
      case 'put':
        return this.#store.put(revision, order.document, order.what);
      case 'version':
        return this.#store.saveVersion(revision, order.comment, order.key);
      case 'restore':
        return this.#store.restore(revision, order.version, order.key);
      default:
        return this.#store[order.kind](revision, order.key);
    }
  }

  #take(view: DesignView): void {
    this.view = view;
    this.keptAt = view.changed_at;
    this.keeping = 'kept';
    if (this.#isHeld) return;
    if (!same(view.document, this.document)) this.document = view.document;
    this.#copies.forget(view.id);
  }

  async #rest(): Promise<void> {
    this.keeping = 'away';
    this.refusal = 'station does not answer';
    this.#tell();
    await new Promise<void>((go) => {
      const timer = setTimeout(go, RETRY_MS);
      this.#wake = () => {
        clearTimeout(timer);
        go();
      };
    });
    this.#wake = null;
  }

  /** What was sent as a change may have been taken although the answer was lost. */
  async #clash(order: Order): Promise<void> {
    try {
      const theirs = await this.#store.read();
      if (order.kind === 'put' && same(theirs.document, order.document)) {
        this.#done(theirs, this.#orders.slice(1));
        return;
      }
      if (same(theirs.document, this.document)) {
        const versions = this.#orders.filter(({ kind }) => kind === 'version');
        this.#done(theirs, versions);
        return;
      }
      this.conflict = { theirs, mine: this.document };
      this.keeping = 'conflict';
      this.refusal = `changed by ${theirs.changed_by}`;
    } catch {
      await this.#rest();
    }
  }

  /** The station does not take it as it is: it stays here, and the next change may cure it. */
  #refuse(error: unknown): void {
    this.#orders = this.#orders.slice(1);
    this.keeping = 'refused';
    this.refusal = sentence(error);
    this.errors = error instanceof Problem ? error.errors : [];
  }
}

function isAway(error: unknown): boolean {
  return error instanceof Problem && (error.status === 0 || error.status >= 500);
}

export function copyName(name: string, who: string, ending = 'copy'): string {
  const behind = ` (${ending}${who ? ` of ${who}` : ''})`;
  return `${name.slice(0, 60 - behind.length)}${behind}`;
}
