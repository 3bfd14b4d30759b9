import { sentence } from '../api/problem';

/** Something that is read from the station as a whole, and read again when it may have changed. */
export class Fetched<T> {
  /** What was read last; `null` before the first answer. */
  value = $state.raw<T | null>(null);
  /** Why it was not read, or why what was asked for was not done; the next answer clears it. */
  refusal = $state.raw('');
  readonly #read: () => Promise<T>;
  #asked = 0;

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
      this.refusal = '';
    } catch (error) {
      if (mine === this.#asked) this.refusal = sentence(error);
    }
  };

  /** Do something and read it again; tells whether it was done. */
  async after(action: () => Promise<unknown>): Promise<boolean> {
    try {
      await action();
    } catch (error) {
      this.#asked++;
      this.refusal = sentence(error);
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
