import { untrack } from 'svelte';
import { sentence } from '../../api/problem';
import type { FieldMap, MapComparison } from '../../api/types';
import { JobWatch } from '../../live/job_watch.svelte';
import type { Station } from '../../live/station.svelte';

const ASK_EVERY_MS = 4000;

/** The newest comparison of one variable's models, with every model's map. */
export class ComparisonWatch {
  comparison = $state.raw<MapComparison | null>(null);
  maps = $state.raw<Readonly<Record<string, FieldMap>>>({});
  refusal = $state.raw('');
  readonly job: JobWatch;
  readonly #station: Station;
  #robot = '';
  #variable = '';
  #drawn: string | null = null;

  constructor(station: Station) {
    this.#station = station;
    this.job = new JobWatch(station, (job) => {
      if (job?.state === 'failed') this.refusal = job.message;
      void this.#ask();
    });
  }

  /** Follow a variable until the returned function is called. */
  follow(robot: string, variable: string): () => void {
    [this.#robot, this.#variable] = [robot, variable];
    this.comparison = null;
    this.maps = {};
    this.#drawn = null;
    void untrack(() => this.#ask());
    const timer = setInterval(() => void this.#ask(), ASK_EVERY_MS);
    return () => {
      clearInterval(timer);
      this.job.stop();
    };
  }

  async run(): Promise<void> {
    this.refusal = '';
    try {
      const { job } = await this.#station.api.compareModels(this.#robot, this.#variable);
      this.job.follow(job);
    } catch (error) {
      this.refusal = sentence(error);
    }
  }

  async #ask(): Promise<void> {
    const [robot, variable] = [this.#robot, this.#variable];
    const isHere = () => robot === this.#robot && variable === this.#variable;
    try {
      const comparison = await this.#station.api.comparison(robot, variable);
      if (!isHere()) return;
      this.comparison = comparison;
      // Somebody else may have begun one.
      if (comparison.job && !this.job.isRunning) this.job.follow(comparison.job);
      if (comparison.models.length === 0 || comparison.compared_at === this.#drawn) return;
      const found = await Promise.all(
        comparison.models.map(({ model }) => this.#station.api.map(robot, variable, model)),
      );
      if (!isHere()) return;
      this.maps = Object.fromEntries(found.map((map) => [map.model, map]));
      this.#drawn = comparison.compared_at;
    } catch (error) {
      if (isHere()) this.refusal = sentence(error);
    }
  }
}
