import { sentence } from '../api/problem';
import type { Job, Time } from '../api/types';
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
  /** When it ended, where that was before anybody looked. */
  endedAt = $state.raw<Time | null>(null);
  #isResumed = false;
  #isBeginning = $state.raw(false);
  #refused = $state.raw('');
  readonly #watch: JobWatch;
  readonly #ondone: (job: Job) => string;

  /** @param ondone Acts upon a job that did what it was begun for, and tells of it. */
  constructor(station: Station, ondone: (job: Job) => string) {
    this.#watch = new JobWatch(station, (job) => this.#take(job));
    this.#ondone = ondone;
  }

  readonly job = $derived.by(() => this.#watch.job);
  readonly isRunning = $derived.by(() => this.#isBeginning || this.#watch.isRunning);

  async begin(ask: () => Promise<{ id: string }>, subject: string | null = null): Promise<void> {
    if (this.isRunning) return;
    this.#clear(subject);
    this.#isBeginning = true;
    try {
      this.#watch.follow((await ask()).id);
    } catch (error) {
      this.#refused = sentence(error);
    } finally {
      this.#isBeginning = false;
    }
  }

  /** Go on with one that was begun before: by an earlier look at the page, or by somebody else. */
  resume(job: string, subject: string | null = null): void {
    if (this.isRunning) return;
    this.#clear(subject);
    this.#isResumed = true;
    this.#watch.follow(job);
  }

  cancel = (): void => void this.#watch.cancel();
  stop = (): void => this.#watch.stop();

  #clear(subject: string | null): void {
    this.#watch.stop();
    this.#refused = this.outcome = '';
    this.hasFailed = this.#isResumed = false;
    this.endedAt = null;
    this.subject = subject;
  }

  #take(job: Job | null): void {
    this.endedAt = this.#isResumed ? (job?.ended_at ?? null) : null;
    this.hasFailed = job?.state !== 'done' && job?.state !== 'cancelled';
    this.outcome = this.#told(job);
  }

  #told(job: Job | null): string {
    if (job === null) return 'The station knows nothing of this any more; ask again.';
    if (job.state === 'done') return this.#ondone(job);
    return job.state === 'cancelled' ? 'Cancelled.' : job.message;
  }
}
