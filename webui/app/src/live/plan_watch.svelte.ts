import { untrack } from 'svelte';
import { sentence } from '../api/problem';
import type { Mission, ObjectivePoint, Plan } from '../api/types';
import { Fetched } from './fetched.svelte';
import type { Station } from './station.svelte';

const AGAIN_MS = 1000;

/** One plan, fetched whole whenever its state changes and kept current in between. */
export class PlanWatch {
  #id = $state.raw<string | null>(null);
  #whole = $state.raw<Plan | null>(null);
  #curve = $state.raw<readonly ObjectivePoint[]>([]);
  /** Why the plan could not be fetched, until it is. */
  refusal = $state.raw('');
  #again: ReturnType<typeof setTimeout> | undefined;
  #isFollowed = false;
  readonly #station: Station;

  constructor(station: Station) {
    this.#station = station;
  }

  readonly #news = $derived.by(() =>
    this.#id === null ? undefined : this.#station.plans[this.#id],
  );

  readonly plan = $derived.by((): Plan | null => {
    if (this.#whole === null || this.#whole.id !== this.#id) return null;
    return { ...this.#whole, ...(this.#news ?? {}) };
  });

  /** Best objective over planning time, as far as it is known. */
  readonly curve = $derived.by((): readonly ObjectivePoint[] => {
    const whole = this.plan?.history ?? [];
    return whole.length >= this.#curve.length ? whole : this.#curve;
  });

  /** Whether all is known of what is to be shown: it has come, or there is none. */
  isKnown(id: string | null): boolean {
    return id === null || this.plan?.id === id;
  }

  /** Follow a plan until the returned function is called; for effects. */
  follow(id: string | null): () => void {
    this.#isFollowed = true;
    if (untrack(() => this.#id) !== id) {
      this.#id = id;
      this.#whole = null;
      this.#curve = [];
      this.refusal = '';
    }
    const news = this.#news;
    this.#collect(news);
    const whole = untrack(() => this.#whole);
    if (id !== null && (whole === null || !isCurrent(whole, news))) void this.#fetch(id);
    return () => {
      this.#isFollowed = false;
      clearTimeout(this.#again);
    };
  }

  #collect(news: Partial<Plan> | undefined): void {
    const progress = news?.progress;
    if (!progress || progress.objective === null) return;
    const curve = untrack(() => this.#curve);
    const last = curve.at(-1);
    if (last && progress.elapsed_s <= last.elapsed_s) return;
    const { elapsed_s, objective, candidates } = progress;
    this.#curve = [...curve, { elapsed_s, objective, candidates }];
  }

  /** Fetch the plan; once more when the station was silent or its answer is older than its news. */
  async #fetch(id: string): Promise<void> {
    try {
      const plan = await this.#station.api.plan(id);
      if (untrack(() => this.#id) !== id) return;
      this.#whole = plan;
      this.refusal = '';
      if (
        isCurrent(
          plan,
          untrack(() => this.#news),
        )
      )
        return;
    } catch (error) {
      if (untrack(() => this.#id) !== id) return;
      this.refusal = sentence(error);
    }
    clearTimeout(this.#again);
    if (!this.#isFollowed) return;
    this.#again = setTimeout(() => void this.#fetch(id), AGAIN_MS);
  }
}

/** Whether a plan was fetched in the state and stage that the live stream tells. */
function isCurrent(whole: Plan, news: Partial<Plan> | undefined): boolean {
  const { state = whole.state, stage = whole.stage } = news ?? {};
  return state === whole.state && (stage ?? null) === (whole.stage ?? null);
}

/** One mission, fetched whole whenever the live stream says that it changed. */
export class MissionWatch {
  #id = $state.raw<string | null>(null);
  readonly #station: Station;
  readonly #source: Fetched<Mission | null>;

  constructor(station: Station) {
    this.#station = station;
    this.#source = new Fetched(() =>
      this.#id === null ? Promise.resolve(null) : station.api.mission(this.#id),
    );
  }

  readonly #news = $derived.by(() =>
    this.#id === null ? undefined : this.#station.missions[this.#id],
  );
  /** What of it is reason to fetch it anew. */
  readonly #stamp = $derived.by(() => {
    const { state, plan_id, budget, message, ahead, map_std } = this.#news ?? {};
    return JSON.stringify([state, plan_id, budget?.spent, message, ahead, map_std]);
  });

  readonly mission = $derived.by((): Mission | null => {
    const whole = this.#source.value;
    if (whole === null || whole.id !== this.#id) return null;
    return { ...whole, ...(this.#news ?? {}) };
  });

  /** Follow a mission until the returned function is called; for effects. */
  follow(id: string | null): () => void {
    this.#id = id;
    void [this.#stamp, this.#station.revision('mission')];
    return this.#source.follow(id);
  }

  readonly refusal = $derived.by(() => this.#source.refusal);

  /** Whether all is known of what is to be shown: it has come, or there is none. */
  isKnown(id: string | null): boolean {
    return id === null || this.mission?.id === id;
  }

  refresh(): Promise<void> {
    return this.#source.load();
  }
}
