import { Problem, sentence } from '../api/problem';
import type { Job } from '../api/types';
import type { Station } from './station.svelte';

/** A station that was started again knows no job from before. */
const GONE = 404;
const ENDED_WITH_STATION =
  'The station was started again meanwhile, and this work ended with it. Begin it again.';

/** One job of the station, followed until it has ended or is forgotten. */
export class JobWatch {
  job = $state.raw<Job | null>(null);
  refusal = $state.raw('');
  readonly #station: Station;
  readonly #onend: (job: Job | null) => void;
  #id: string | null = null;
  #unfollow: (() => void) | undefined;

  constructor(station: Station, onend: (job: Job | null) => void) {
    this.#station = station;
    this.#onend = onend;
  }

  readonly isRunning = $derived(this.job?.state === 'queued' || this.job?.state === 'running');

  follow(id: string | null): void {
    if (id === this.#id) return;
    this.stop();
    this.#id = id;
    if (id === null) return;
    this.#unfollow = this.#station.onBatch(({ jobs }, isFirst) => {
      const told = jobs[id];
      if (told) this.#take(told);
      else if (isFirst) void this.#ask(id);
    });
    void this.#ask(id);
  }

  stop(): void {
    this.#end();
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

  #end(): void {
    this.#unfollow?.();
    this.#unfollow = undefined;
  }

  /** Ask once: it may have ended before it was followed, or while the stream was interrupted. */
  async #ask(id: string): Promise<void> {
    const isAwaited = () => this.#id === id && this.#unfollow !== undefined;
    try {
      const job = await this.#station.api.job(id);
      if (isAwaited()) this.#take(job);
    } catch (error) {
      if (!isAwaited()) return;
      const isGone = error instanceof Problem && error.status === GONE;
      this.refusal = isGone && this.isRunning ? ENDED_WITH_STATION : sentence(error);
      if (isGone) {
        this.#end();
        this.job = null;
        this.#onend(null);
      }
    }
  }

  #take(job: Job): void {
    this.job = job;
    this.refusal = '';
    if (job.state === 'queued' || job.state === 'running') return;
    this.#end();
    this.#onend(job);
  }
}
