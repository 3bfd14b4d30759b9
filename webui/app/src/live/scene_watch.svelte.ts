import { sentence } from '../api/problem';
import type { SceneChange, SceneView } from '../api/types';
import type { Station } from './station.svelte';

const ASK_EVERY_MS = 2500;
/** A slider that is dragged is not sent at every pixel. */
const SEND_EVERY_MS = 120;

/** What everybody sees in one robot's 3D view; changes go to the station a few times a second. */
export class SceneWatch {
  view = $state.raw<SceneView | null>(null);
  /** Why the view does not answer or was not changed; the next answer clears it. */
  refusal = $state.raw('');
  readonly #station: Station;
  #robot = '';
  #waiting: SceneChange | null = null;
  #timer: ReturnType<typeof setTimeout> | undefined;
  #isSending = false;

  constructor(station: Station) {
    this.#station = station;
  }

  /** Follow a robot's view until the returned function is called. */
  follow(robot: string): () => void {
    this.#robot = robot;
    this.view = null;
    const controller = new AbortController();
    const ask = () => void this.#ask(controller.signal);
    ask();
    const timer = setInterval(ask, ASK_EVERY_MS);
    return () => {
      controller.abort();
      clearInterval(timer);
    };
  }

  change(change: SceneChange): void {
    if (!this.view) return;
    const { layers, ...plain } = change;
    this.view = {
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

  async #ask(signal: AbortSignal): Promise<void> {
    const robot = this.#robot;
    try {
      const view = await this.#station.api.sceneView(robot, signal);
      // What is being dragged is newer than what was answered.
      const isSettled = this.#waiting === null && !this.#isSending;
      if (robot !== this.#robot || signal.aborted) return;
      if (isSettled) this.view = view;
      this.refusal = '';
    } catch (error) {
      if (!signal.aborted) this.refusal = sentence(error);
    }
  }

  async #send(): Promise<void> {
    const change = this.#waiting;
    this.#waiting = null;
    this.#timer = undefined;
    if (!change) return;
    this.#isSending = true;
    try {
      await this.#station.api.changeSceneView(this.#robot, change);
    } catch (error) {
      this.refusal = sentence(error);
    } finally {
      this.#isSending = false;
    }
  }
}
