import { sentence } from '../../api/problem';
import type { FieldMap, MapComparison } from '../../api/types';
import { Fetched } from '../../live/fetched.svelte';
import { JobWatch } from '../../live/job_watch.svelte';
import type { Station } from '../../live/station.svelte';

const REST_MS = 4000;

/** The newest comparison of one variable's models, with every model's map. */
export class ComparisonWatch {
  comparison = $state.raw<MapComparison | null>(null);
  maps = $state.raw<Readonly<Record<string, FieldMap>>>({});
  readonly job: JobWatch;
  readonly #station: Station;
  readonly #source = new Fetched(() => this.#read(), REST_MS);
  #refused = $state.raw('');
  #robot = '';
  #variable = '';
  #drawn: string | null = null;

  constructor(station: Station) {
    this.#station = station;
    this.job = new JobWatch(station, (job) => {
      if (job?.state === 'failed') this.#refused = job.message;
      void this.#source.load();
    });
  }

  readonly refusal = $derived.by(() => this.#refused || this.#source.refusal);

  /** Somebody else may begin one. */
  readonly #others = $derived.by(() =>
    Object.values(this.#station.jobs)
      .filter(({ kind, state }) => kind === 'map comparison' && state === 'running')
      .map(({ id }) => id)
      .join(),
  );

  /** Follow a variable; for effects. */
  follow(robot: string, variable: string): () => void {
    void [this.#others, this.#station.revision('maps', robot)];
    if (robot !== this.#robot || variable !== this.#variable) {
      [this.#robot, this.#variable] = [robot, variable];
      this.comparison = null;
      this.maps = {};
      this.#drawn = null;
      this.job.stop();
    }
    return this.#source.follow(`${robot} ${variable}`);
  }

  stop(): void {
    this.job.stop();
  }

  async run(): Promise<void> {
    this.#refused = '';
    try {
      const { id } = await this.#station.api.compareModels(this.#robot, this.#variable);
      this.job.follow(id);
    } catch (error) {
      this.#refused = sentence(error);
    }
  }

  async #read(): Promise<void> {
    const [robot, variable] = [this.#robot, this.#variable];
    const isHere = () => robot === this.#robot && variable === this.#variable;
    const comparison = await this.#station.api.comparison(robot, variable);
    if (!isHere()) return;
    this.comparison = comparison;
    if (comparison.job && !this.job.isRunning) this.job.follow(comparison.job);
    if (comparison.models.length === 0 || comparison.compared_at === this.#drawn) return;
    const found = await Promise.all(
      comparison.models.map(({ model }) => this.#station.api.map(robot, variable, model)),
    );
    if (!isHere()) return;
    this.maps = Object.fromEntries(found.map((map) => [map.model, map]));
    this.#drawn = comparison.compared_at;
  }
}
