/**
 * Asks for what is wanted last: one question at a time, and what was overtaken meanwhile is never
 * asked. So a slider that is dragged costs no more than the answers that can be shown.
 */
export class NewestQuestion<Q> {
  #wanted: { question: Q } | null = null;
  #isAsking = false;
  readonly #ask: (question: Q) => Promise<void>;

  /** @param ask Asks and takes the answer; it never fails. */
  constructor(ask: (question: Q) => Promise<void>) {
    this.#ask = ask;
  }

  want(question: Q): void {
    this.#wanted = { question };
    if (!this.#isAsking) void this.#run();
  }

  async #run(): Promise<void> {
    this.#isAsking = true;
    while (this.#wanted !== null) {
      const { question } = this.#wanted;
      this.#wanted = null;
      await this.#ask(question);
    }
    this.#isAsking = false;
  }
}
