/** A page that draws nothing, such as one in the background, takes what came after so long, ms. */
const LONGEST_MS = 100;

/**
 * Hands on what came since the last picture, all at once.
 *
 * A page that is busy catches up in one go, instead of drawing what was true before.
 */
export class FrameQueue<T> {
  #waiting: T[] = [];
  #end: (() => void) | null = null;
  readonly #take: (items: readonly T[]) => void;

  constructor(take: (items: readonly T[]) => void) {
    this.#take = take;
  }

  put(item: T): void {
    this.#waiting.push(item);
    if (this.#end !== null) return;
    const frame = requestAnimationFrame(() => this.#flush());
    const timer = setTimeout(() => this.#flush(), LONGEST_MS);
    this.#end = () => {
      cancelAnimationFrame(frame);
      clearTimeout(timer);
    };
  }

  /** Forget what waits. */
  clear(): void {
    this.#end?.();
    this.#end = null;
    this.#waiting = [];
  }

  #flush(): void {
    const items = this.#waiting;
    this.clear();
    this.#take(items);
  }
}
