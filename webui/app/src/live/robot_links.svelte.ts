import type { RobotLink } from '../api/types';
import { Fetched } from './fetched.svelte';
import type { Station } from './station.svelte';

/** The links of a robot, as the live stream or else the station's answer tells them. */
export class RobotLinks {
  readonly #station: Station;
  readonly #robot: string;
  readonly #asked: Fetched<readonly RobotLink[]>;

  constructor(station: Station, robot: string) {
    this.#station = station;
    this.#robot = robot;
    this.#asked = new Fetched(() => station.api.links(robot));
  }

  readonly list = $derived.by(
    (): readonly RobotLink[] =>
      this.#station.live[this.#robot]?.report?.links ?? this.#asked.value ?? [],
  );
  readonly refusal = $derived.by(() => this.#asked.refusal);
  readonly isKnown = $derived.by(
    () =>
      this.#asked.value !== null || this.#station.live[this.#robot]?.report?.links !== undefined,
  );

  /** Keep them current until the returned function is called; for effects. */
  follow(): () => void {
    return this.#asked.follow();
  }

  plug(uri: string, plugged: boolean): Promise<boolean> {
    return this.#asked.after(() => this.#station.api.plug(this.#robot, uri, plugged));
  }
}
