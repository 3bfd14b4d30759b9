import { sentence } from '../api/problem';
import type { Job } from '../api/types';
import { JobWatch } from './job_watch.svelte';
import type { Station } from './station.svelte';

/** A job that is begun here and watched to its end: how far it is, how it ended, or why not. */
export class Errand {
  /** Why it was not begun, or is not heard of. */
  readonly refusal = $derived.by(() => this.#refused || this.#watch.refusal);
  /** How it ended, a sentence; empty while it has not. */
  outcome = $state.raw('');
  /** Whether it ended without what it was begun for. */
  hasFailed = $state.raw(false);
  /** What is worked on, where one page may begin several. */
  subject = $state.raw<string | null>(null);
  #isBeginning = $state.raw(false);
  #refused = $state.raw('');
  readonly #watch: JobWatch;
  readonly #ondone: (job: Job) => void;

  constructor(station: Station, ondone: (job: Job) => void = () => undefined) {
    this.#watch = new JobWatch(station, (job) => this.#take(job));
    this.#ondone = ondone;
  }

  readonly job = $derived.by(() => this.#watch.job);
  readonly isRunning = $derived.by(() => this.#isBeginning || this.#watch.isRunning);

  async begin(ask: () => Promise<{ job: string }>, subject: string | null = null): Promise<void> {
    if (this.isRunning) return;
    this.#watch.stop();
    this.#refused = this.outcome = '';
    this.hasFailed = false;
    this.subject = subject;
    this.#isBeginning = true;
    try {
      this.#watch.follow((await ask()).job);
    } catch (error) {
      this.#refused = sentence(error);
    } finally {
      this.#isBeginning = false;
    }
  }

  cancel = (): void => void this.#watch.cancel();
  stop = (): void => this.#watch.stop();

  #take(job: Job | null): void {
    this.hasFailed = job?.state !== 'done';
    const unknown = 'The station knows nothing of this any more; ask again.';
    const cancelled = job?.state === 'cancelled' ? 'Cancelled.' : '';
    this.outcome = job === null ? unknown : job.message || cancelled;
    if (job?.state === 'done') this.#ondone(job);
  }
}
