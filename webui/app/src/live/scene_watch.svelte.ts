import { untrack } from 'svelte';
import { sentence } from '../api/problem';
import type { SceneChange, SceneView } from '../api/types';
import { Fetched } from './fetched.svelte';
import type { Station } from './station.svelte';

/** A slider that is dragged is not sent at every pixel. */
const SEND_EVERY_MS = 120;

/** What everybody sees in one robot's 3D view; changes go to the station a few times a second. */
export class SceneWatch {
  readonly #station: Station;
  readonly #source: Fetched<SceneView>;
  #robot = $state.raw('');
  /** What is being dragged: newer than what was answered. */
  #own = $state.raw<SceneView | null>(null);
  #unchanged = $state.raw('');
  #waiting: SceneChange | null = null;
  #timer: ReturnType<typeof setTimeout> | undefined;

  constructor(station: Station) {
    this.#station = station;
    this.#source = new Fetched(() => station.api.sceneView(this.#robot));
  }

  readonly view = $derived.by((): SceneView | null => this.#own ?? this.#source.value);
  /** Why the view does not answer or was not changed; the next answer clears it. */
  readonly refusal = $derived.by(() => this.#unchanged || this.#source.refusal);

  /** Follow a robot's view; for effects. */
  follow(robot: string): () => void {
    void this.#station.revision('view', robot);
    if (robot !== untrack(() => this.#robot)) {
      this.#robot = robot;
      this.#source.value = this.#own = null;
    }
    return this.#source.follow(robot);
  }

  change(change: SceneChange): void {
    if (!this.view) return;
    const { layers, ...plain } = change;
    this.#own = {
      ...this.view,
      ...plain,
      layers: this.view.layers.map((layer) => ({
        ...layer,
        visible: layers?.[layer.key] ?? layer.visible,
      })),
    };
    const before = this.#waiting ?? {};
    this.#waiting = { ...before, ...change };
    if (layers) this.#waiting.layers = { ...before.layers, ...layers };
    this.#timer ??= setTimeout(() => void this.#send(), SEND_EVERY_MS);
  }

  async #send(): Promise<void> {
    const [robot, change] = [this.#robot, this.#waiting];
    this.#waiting = null;
    this.#timer = undefined;
    if (!change) return;
    try {
      const view = await this.#station.api.changeSceneView(robot, change);
      if (robot === this.#robot) this.#source.value = view;
      this.#unchanged = '';
    } catch (error) {
      this.#unchanged = sentence(error);
    }
    this.#settle();
  }

  /** What the station answered holds, unless something was dragged on since. */
  #settle(): void {
    if (this.#waiting === null) this.#own = null;
  }
}
