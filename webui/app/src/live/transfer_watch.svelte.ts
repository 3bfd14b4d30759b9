import type { Plan, Transfer } from '../api/types';
import type { Station } from './station.svelte';

const ASK_EVERY_MS = 1000;

/** The newest way of a plan to its robot: as the live stream tells it, or asked for. */
export class TransferWatch {
  #id = $state.raw<string | null>(null);
  #asked = $state.raw<Transfer | null>(null);
  readonly #station: Station;
  readonly #plan: () => Plan | null;

  constructor(station: Station, plan: () => Plan | null) {
    this.#station = station;
    this.#plan = plan;
  }

  readonly transfer = $derived.by((): Transfer | null => {
    const plan = this.#plan();
    const told = plan?.transfer ?? null;
    const asked = this.#asked?.plan_id === plan?.id ? this.#asked : null;
    return asked !== null && (told === null || told.started_at <= asked.started_at) ? asked : told;
  });

  /** Follow a transfer that was just begun. */
  begin(id: string): void {
    this.#id = id;
  }

  /** Ask for what is under way again and again; to be called inside an effect. */
  follow(): (() => void) | undefined {
    const { transfer } = this;
    const open = transfer !== null && transfer.ended_at === null ? transfer.id : null;
    const id = this.#id ?? open;
    if (id === null) return undefined;
    const timer = setInterval(() => void this.#ask(id), ASK_EVERY_MS);
    return () => clearInterval(timer);
  }

  /** Ask once more, now. */
  async refresh(): Promise<void> {
    const id = this.#id ?? this.transfer?.id;
    if (id !== undefined) await this.#ask(id);
  }

  async #ask(id: string): Promise<void> {
    try {
      const transfer = await this.#station.api.transfer(id);
      if (this.#id !== null && this.#id !== id) return;
      this.#asked = transfer;
      if (transfer.ended_at !== null) this.#id = null;
    } catch {
      // What is known stays on the screen with its times; the next round asks again.
    }
  }
}
