import { sentence } from '../api/problem';

/** Something that is read from the station as a whole, and read again when it may have changed. */
export class Fetched<T> {
  /** What was read last; `null` before the first answer. */
  value = $state.raw<T | null>(null);
  #unread = $state.raw('');
  #undone = $state.raw('');
  readonly #read: () => Promise<T>;
  #asked = 0;

  /** Why it was not read, until it is, or why something was not done, until the next is. */
  readonly refusal = $derived(this.#undone || this.#unread);

  constructor(read: () => Promise<T>) {
    this.#read = read;
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

  /** Read it now and every so often, until the returned function is called. */
  every(ms: number): () => void {
    void this.load();
    const timer = setInterval(() => void this.load(), ms);
    return () => {
      clearInterval(timer);
      this.#asked++;
    };
  }
}
