import { untrack } from 'svelte';
import type { Api } from '../api/client';
import { rfc3339 } from '../text/time';
import type { ReplayClock } from './cursor.svelte';

/** More than any robot measures in the blocks of a short window, so that nothing is left out. */
const POINTS = 20_000;
const KEPT = 24;
const RETRY_MS = 3000;
const NONE: readonly [number, number] = [0, -1];
/** So far is read ahead of a replay that plays, s of a wall clock, and at most so many blocks. */
const AHEAD_S = 30;
const AHEAD_BLOCKS = 3;

interface Block {
  t: number[];
  v: (number | null)[];
  unit: string;
  isDerived: boolean;
  isDecimated: boolean;
  /** When each was heard, s since 1970; `null` where that is not kept. */
  received: number[] | null;
}

interface Shown extends Omit<Block, 'received'> {
  isWhole: boolean;
  /** Whether it is known of all when they were heard. */
  isArrivalKept: boolean;
}

/**
 * Whether the station had heard of a value by a moment, s since 1970; of one whose arrival is not
 * kept, whether it had been measured by then.
 */
export function isHeard(atS: number, measured: number, received: number | null): boolean {
  return (received ?? measured) <= atS && measured <= atS;
}

/** Values of one channel around a cursor: read in blocks, and ahead of where it plays. */
export class ReplayWindow {
  /** Grows when another block has come. */
  version = $state.raw(0);
  // eslint-disable-next-line svelte/prefer-svelte-reactivity -- `version` tells when it changed
  readonly #blocks = new Map<number, Block | null>();
  readonly #api: Api;
  /** First and last block that the window needs, or will need. */
  #wanted = NONE;

  /**
   * @param spanS Length of the window, and of a block, s.
   */
  constructor(
    api: Api,
    readonly robot: string,
    readonly channel: string,
    readonly spanS: number,
  ) {
    this.#api = api;
  }

  /** Bounds of the window about a moment, s since 1970: the moment is in its middle. */
  range(atS: number): [number, number] {
    return [atS - this.spanS / 2, atS + this.spanS / 2];
  }

  /**
   * Read what the window about a moment needs, and what it will need, until the returned function
   * is called; for effects.
   */
  want(atS: number, speed: number): () => void {
    const [from, to] = this.range(atS);
    const ahead = Math.min(speed * AHEAD_S, AHEAD_BLOCKS * this.spanS);
    this.#wanted = [this.#number(from), this.#number(to + ahead)];
    untrack(() => this.#readWanted());
    return () => (this.#wanted = NONE);
  }

  /**
   * What is known of the window about a moment, in order; all of it once `isWhole`.
   *
   * @param clock By which it is told: `received` leaves out what the station had not heard by then.
   */
  show(atS: number, clock: ReplayClock = 'measured'): Shown {
    void this.version;
    const [from, to] = this.range(atS);
    const all: Shown = {
      t: [],
      v: [],
      unit: '',
      isDerived: false,
      isDecimated: false,
      isWhole: true,
      isArrivalKept: true,
    };
    for (let n = this.#number(from); n <= this.#number(to); n++) {
      const block = this.#blocks.get(n);
      if (!block) {
        all.isWhole = false;
        continue;
      }
      block.t.forEach((at, i) => {
        if (clock === 'received' && !isHeard(atS, at, block.received?.[i] ?? null)) return;
        all.t.push(at);
        all.v.push(block.v[i] ?? null);
      });
      all.isArrivalKept &&= block.received !== null || block.t.length === 0;
      all.unit ||= block.unit;
      all.isDerived ||= block.isDerived;
      all.isDecimated ||= block.isDecimated;
    }
    return all;
  }

  #number(s: number): number {
    return Math.floor(s / this.spanS);
  }

  #readWanted(): void {
    for (let n = this.#wanted[0]; n <= this.#wanted[1]; n++) {
      if (!this.#blocks.has(n)) void this.#read(n);
    }
  }

  #isWanted(n: number): boolean {
    return n >= this.#wanted[0] && n <= this.#wanted[1];
  }

  async #read(n: number): Promise<void> {
    this.#blocks.set(n, null);
    try {
      const found = await this.#api.samples(this.robot, {
        channel: this.channel,
        start: rfc3339(n * this.spanS * 1000),
        end: rfc3339((n + 1) * this.spanS * 1000),
        max_points: POINTS,
      });
      // Both ends are included; what lies on the next block's first is the next block's.
      const t = found.measured_at.map((at) => Date.parse(at) / 1000);
      const count = t.filter((at) => at < (n + 1) * this.spanS).length;
      this.#blocks.set(n, {
        t: t.slice(0, count),
        v: found.value.slice(0, count),
        unit: found.unit,
        isDerived: found.is_derived,
        isDecimated: found.decimated,
        received: found.received_at?.map((at) => Date.parse(at) / 1000) ?? null,
      });
      this.#forget();
    } catch {
      this.#blocks.delete(n);
      setTimeout(() => this.#readWanted(), RETRY_MS);
    }
    this.version++;
  }

  /** Let go of the blocks that were read first; never of one that is wanted. */
  #forget(): void {
    for (const n of this.#blocks.keys()) {
      if (this.#blocks.size <= KEPT) return;
      if (!this.#isWanted(n) && this.#blocks.get(n) !== null) this.#blocks.delete(n);
    }
  }
}
