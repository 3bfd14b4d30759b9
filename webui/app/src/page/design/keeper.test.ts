import { afterEach, beforeEach, describe, expect, test, vi } from 'vitest';
import { Problem } from '../../api/problem';
import { PLAIN_MANNER, PLAIN_SURFACING, type Design, type DesignView } from './document';
import { Keeper, type DesignStore } from './keeper.svelte';
import { SafetyCopies } from './safety_copy';

const AWAY = new Problem(0, 'The station did not answer.', '');
const OVERTAKEN = new Problem(412, 'Changed', '');
const REFUSED = new Problem(422, 'Refused', 'It is too deep.');

function design(north_m: number): Design {
  return {
    content: { kind: 'waypoints', waypoints: [{ north_m, east_m: 0 }], returns: false },
    manner: PLAIN_MANNER,
    surfacing: PLAIN_SURFACING,
  };
}

/** A station that keeps one design as the real one does. */
class Kept implements DesignStore {
  steps: { document: Design; what: string; by: string }[] = [
    { document: design(0), what: 'Begun', by: 'ann' },
  ];
  at = 0;
  revision = 1;
  versions: string[] = [];
  copies: { name: string; document: Design }[] = [];
  /** What is thrown at the next calls, before anything is done. */
  faults: Problem[] = [];

  view(): DesignView {
    const step = this.steps[this.at] as (typeof this.steps)[number];
    return {
      id: 'design-1',
      robot: 'mini-1',
      name: 'Bay',
      revision: this.revision,
      document: step.document,
      changed_at: '2026-11-21T12:31:05Z',
      changed_by: step.by,
      what: step.what,
      undo: this.steps
        .slice(1, this.at + 1)
        .map(({ what }) => what)
        .toReversed(),
      redo: this.steps.slice(this.at + 1).map(({ what }) => what),
      versions: [],
    } as unknown as DesignView;
  }

  change(document: Design, what: string, by: string): DesignView {
    this.steps = [...this.steps.slice(0, this.at + 1), { document, what, by }];
    this.at = this.steps.length - 1;
    this.revision++;
    return this.view();
  }

  #begin(revision: number): void {
    const fault = this.faults.shift();
    if (fault) throw fault;
    if (revision !== this.revision) throw OVERTAKEN;
  }

  read = () => Promise.resolve(this.view());
  put = async (revision: number, document: Design, what: string) => {
    await Promise.resolve();
    this.#begin(revision);
    return this.change(document, what, 'me');
  };
  #move(revision: number, step: number): DesignView {
    this.#begin(revision);
    this.at += step;
    this.revision++;
    return this.view();
  }
  undo = async (revision: number) => Promise.resolve().then(() => this.#move(revision, -1));
  redo = async (revision: number) => Promise.resolve().then(() => this.#move(revision, 1));
  readonly #answered = new Set<string>();
  saveVersion = async (revision: number, comment: string, key: string) => {
    await Promise.resolve();
    this.#begin(revision);
    if (!this.#answered.has(key)) this.versions.push(comment);
    this.#answered.add(key);
    return this.view();
  };
  restore = (revision: number) => this.undo(revision);
  copy = async (name: string, document: Design) => {
    await Promise.resolve();
    this.copies.push({ name, document });
  };
}

class Memory {
  readonly #rows = new Map<string, string>();
  get length(): number {
    return this.#rows.size;
  }
  key = (i: number) => [...this.#rows.keys()][i] ?? null;
  getItem = (key: string) => this.#rows.get(key) ?? null;
  setItem = (key: string, value: string) => void this.#rows.set(key, value);
  removeItem = (key: string) => void this.#rows.delete(key);
}

let station: Kept;
let memory: Memory;
let keeper: Keeper;

beforeEach(() => {
  vi.useFakeTimers();
  station = new Kept();
  memory = new Memory();
  const copies = new SafetyCopies(memory as unknown as Storage, 'page-1');
  keeper = new Keeper(station.view(), station, copies, () => 'me');
});
afterEach(() => vi.useRealTimers());

const settle = () => vi.advanceTimersByTimeAsync(50);

describe('what is changed', () => {
  test('is kept as one step each, in order, and the safety copy goes', async () => {
    keeper.change(design(1), 'Moved waypoint 1');
    keeper.change(design(2), 'Moved waypoint 1');
    expect(keeper.keeping).toBe('keeping');
    expect(memory.length).toBe(1);
    await settle();
    expect(station.steps.map(({ document }) => document)).toEqual([
      design(0),
      design(1),
      design(2),
    ]);
    expect(keeper.keeping).toBe('kept');
    expect(memory.length).toBe(0);
  });

  test('joins the nudge before it that was not sent yet', async () => {
    for (const north of [1, 2, 3, 4]) keeper.change(design(north), 'Nudged', 'nudge 0');
    await settle();
    expect(station.steps.length).toBe(3);
    expect(station.view().document).toEqual(design(4));
  });

  test('waits while the station is away, is said to be not kept, and goes by itself', async () => {
    station.faults = [AWAY, AWAY];
    keeper.change(design(1), 'Moved waypoint 1');
    await settle();
    expect([keeper.keeping, keeper.refusal]).toEqual(['away', 'station does not answer']);
    keeper.change(design(2), 'Moved waypoint 1');
    expect(keeper.document).toEqual(design(2));
    await vi.advanceTimersByTimeAsync(5000);
    expect(station.view().document).toEqual(design(2));
    expect(keeper.keeping).toBe('kept');
  });

  test('that the station refuses stays on the screen, and the next change may cure it', async () => {
    station.faults = [REFUSED];
    keeper.change(design(1), 'Moved waypoint 1');
    await settle();
    expect([keeper.keeping, keeper.refusal]).toEqual(['refused', 'It is too deep.']);
    expect(keeper.document).toEqual(design(1));
    keeper.change(design(2), 'Moved waypoint 1');
    await settle();
    expect(keeper.keeping).toBe('kept');
  });

  test('is undone and redone at once on the screen and at the station', async () => {
    keeper.change(design(1), 'Moved waypoint 1');
    await settle();
    keeper.undo();
    expect(keeper.document).toEqual(design(0));
    await settle();
    expect(station.view().document).toEqual(design(0));
    keeper.redo();
    await settle();
    expect(station.view().document).toEqual(design(1));
    expect(keeper.document).toEqual(design(1));
  });

  test('is undone after a reload by the steps of the station', async () => {
    station.change(design(1), 'Moved waypoint 1', 'me');
    keeper = new Keeper(
      station.view(),
      station,
      new SafetyCopies(memory as unknown as Storage, 'page-2'),
      () => 'me',
    );
    expect(keeper.canUndo).toBe(true);
    keeper.undo();
    await settle();
    expect(keeper.document).toEqual(design(0));
  });
});

describe('two editors', () => {
  async function clash(): Promise<void> {
    station.change(design(5), 'Moved waypoint 1', 'bob');
    keeper.change(design(1), 'Moved waypoint 1');
    await settle();
  }

  test('are told of each other, and nothing of either is lost', async () => {
    await clash();
    expect(keeper.conflict?.theirs.changed_by).toBe('bob');
    expect(keeper.document).toEqual(design(1));
    expect(station.view().document).toEqual(design(5));
  });

  test('take theirs: mine is a design of its own', async () => {
    await clash();
    await keeper.takeTheirs();
    expect(keeper.document).toEqual(design(5));
    expect(station.copies).toEqual([{ name: 'Bay (copy of me)', document: design(1) }]);
    expect(keeper.keeping).toBe('kept');
  });

  test('put mine on top: theirs is a version, and one undo away', async () => {
    await clash();
    await keeper.putMine();
    await settle();
    expect(station.versions).toEqual(['bob: Moved waypoint 1']);
    expect(station.view().document).toEqual(design(1));
    keeper.undo();
    await settle();
    expect(station.view().document).toEqual(design(5));
  });

  test('see what the other one did as long as they have changed nothing themselves', async () => {
    station.change(design(5), 'Moved waypoint 1', 'bob');
    await keeper.look();
    expect(keeper.document).toEqual(design(5));
    expect(keeper.news?.changed_by).toBe('bob');
  });

  test('do not clash over a change whose answer alone was lost', async () => {
    const { put } = station;
    station.put = async (...call) => {
      station.put = put;
      await put(...call);
      throw AWAY;
    };
    keeper.change(design(1), 'Moved waypoint 1');
    await vi.advanceTimersByTimeAsync(5000);
    expect(keeper.conflict).toBeNull();
    expect(keeper.keeping).toBe('kept');
    expect(station.steps.length).toBe(2);
  });
});

describe('an answer that was lost', () => {
  function lose(method: 'put' | 'saveVersion'): void {
    const whole = station[method] as (...call: unknown[]) => Promise<DesignView>;
    Object.assign(station, {
      [method]: async (...call: unknown[]) => {
        Object.assign(station, { [method]: whole });
        await whole(...call);
        throw AWAY;
      },
    });
  }

  test('is no conflict with oneself while another change waits', async () => {
    lose('put');
    keeper.change(design(1), 'Moved waypoint 1');
    keeper.change(design(2), 'Moved waypoint 2');
    keeper.saveVersion('moved');
    await vi.advanceTimersByTimeAsync(5000);
    expect(keeper.conflict).toBeNull();
    expect(station.steps.map(({ document }) => document)).toEqual([
      design(0),
      design(1),
      design(2),
    ]);
    expect(station.versions).toEqual(['moved']);
    expect(keeper.keeping).toBe('kept');
  });

  test('of a version makes no second one', async () => {
    lose('saveVersion');
    keeper.saveVersion('as it is');
    await vi.advanceTimersByTimeAsync(5000);
    expect(station.versions).toEqual(['as it is']);
    expect(keeper.keeping).toBe('kept');
  });
});

describe('the safety copy', () => {
  test('of a page that was closed in the middle of a drag is offered', () => {
    keeper.preview(design(9), 'Moved waypoint 1');
    const later = new SafetyCopies(memory as unknown as Storage, 'page-2');
    const [copy] = later.left(station.view(), new Set());
    expect(copy).toMatchObject({ document: design(9), what: 'Moved waypoint 1', revision: 1 });
    later.drop('design-1', copy as NonNullable<typeof copy>);
    expect(memory.length).toBe(0);
  });

  test('of a page that is still open is left to that page', () => {
    keeper.preview(design(9), 'Moved waypoint 1');
    const later = new SafetyCopies(memory as unknown as Storage, 'page-2');
    expect(later.left(station.view(), new Set(['page-1']))).toEqual([]);
    expect(memory.length).toBe(1);
  });

  test('that says what the station says is not', () => {
    keeper.preview(design(0), '');
    const later = new SafetyCopies(memory as unknown as Storage, 'page-2');
    expect(later.left(station.view(), new Set())).toEqual([]);
  });
});
