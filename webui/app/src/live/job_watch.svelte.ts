import { Problem, sentence } from '../api/problem';
import type { Job } from '../api/types';
import type { Station } from './station.svelte';

const ASK_EVERY_MS = 500;
/** A station that was started again knows no job from before. */
const GONE = 404;

/** One job of the station, asked for again and again until it has ended or is forgotten. */
export class JobWatch {
  job = $state.raw<Job | null>(null);
  refusal = $state.raw('');
  readonly #station: Station;
  readonly #onend: (job: Job | null) => void;
  #id: string | null = null;
  #timer: ReturnType<typeof setTimeout> | undefined;

  constructor(station: Station, onend: (job: Job | null) => void) {
    this.#station = station;
    this.#onend = onend;
  }

  readonly isRunning = $derived(this.job?.state === 'queued' || this.job?.state === 'running');

  follow(id: string | null): void {
    if (id === this.#id) return;
    this.stop();
    this.#id = id;
    if (id !== null) void this.#ask(id);
  }

  stop(): void {
    clearTimeout(this.#timer);
    this.#id = null;
    this.job = null;
    this.refusal = '';
  }

  async cancel(): Promise<void> {
    const id = this.#id;
    if (id === null) return;
    try {
      await this.#station.api.cancelJob(id);
    } catch (error) {
      this.refusal = sentence(error);
    }
  }

  async #ask(id: string): Promise<void> {
    try {
      const job = await this.#station.api.job(id);
      if (this.#id !== id) return;
      this.job = job;
      this.refusal = '';
      if (!this.isRunning) {
        this.#onend(job);
        return;
      }
    } catch (error) {
      if (this.#id !== id) return;
      this.refusal = sentence(error);
      if (error instanceof Problem && error.status === GONE) {
        this.#onend(null);
        return;
      }
    }
    this.#timer = setTimeout(() => void this.#ask(id), ASK_EVERY_MS);
  }
}
