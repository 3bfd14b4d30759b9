import { untrack } from 'svelte';
import { sentence } from '../api/problem';

const RETRY_MS = 3000;

/** Something that is read from the station as a whole, and read again when it may have changed. */
export class Fetched<T> {
  /** What was read last; `null` before the first answer. */
  value = $state.raw<T | null>(null);
  #unread = $state.raw('');
  #undone = $state.raw('');
  readonly #read: () => Promise<T>;
  #asked = 0;
  #isFollowed = false;
  #isReading = false;
  /** Whether it may have changed since it was asked for last. */
  #isDue = false;
  #subject: string | null = null;
  readonly #restMs: () => number;

  /** Why it was not read, until it is, or why something was not done, until the next is. */
  readonly refusal = $derived(this.#undone || this.#unread);

  /** @param restMs Between two answers of something that changes all the time. */
  constructor(read: () => Promise<T>, restMs: number | (() => number) = 500) {
    this.#read = read;
    this.#restMs = typeof restMs === 'number' ? () => restMs : restMs;
  }

  /** Read it; of several answers under way the one that was asked for last counts. */
  load = async (): Promise<void> => {
    const mine = ++this.#asked;
    try {
      const value = await this.#read();
      if (mine !== this.#asked) return;
      this.value = value;
      this.#unread = '';
    } catch (error) {
      if (mine === this.#asked) this.#unread = sentence(error);
    }
  };

  /** Do something and read it again; tells whether it was done. */
  async after(action: () => Promise<unknown>): Promise<boolean> {
    try {
      await action();
      this.#undone = '';
    } catch (error) {
      this.#undone = sentence(error);
      return false;
    }
    await this.load();
    return true;
  }

  /**
   * Read it now, and again while that fails, until the returned function is called.
   *
   * For effects: one that also reads `Station.revision` reads again whenever something changed. A
   * change that comes while an answer is under way, or in the rest after it, is asked for after it.
   *
   * @param subject What it is about: of another one it is read at once.
   */
  follow(subject: string | null = null): () => void {
    const isOther = subject !== this.#subject;
    this.#subject = subject;
    this.#isFollowed = this.#isDue = true;
    untrack(() => {
      if (!this.#isReading) void this.#readWhileDue();
      else if (isOther) void this.load();
    });
    return () => (this.#isFollowed = false);
  }

  async #readWhileDue(): Promise<void> {
    this.#isReading = true;
    while (this.#isFollowed && (this.#isDue || this.#unread !== '')) {
      this.#isDue = false;
      await this.load();
      await pause(this.#unread === '' ? this.#restMs() : RETRY_MS);
    }
    this.#isReading = false;
  }
}

function pause(ms: number): Promise<void> {
  return new Promise((go) => setTimeout(go, ms));
}
