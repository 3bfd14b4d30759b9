import type { CameraFix } from '../api/types';
import { rfc3339 } from '../text/time';
import { Fetched } from './fetched.svelte';
import type { Station } from './station.svelte';

/** So far back fixes are asked for, ms of station time: a few of the newest. */
const BACK_MS = 2000;

/** The newest fix of a robot by cameras, and the newest that was refused after it. */
export class FixWatch {
  readonly #station: Station;
  readonly #fetched: Fetched<readonly CameraFix[]>;
  #robot = '';
  newest = $state.raw<CameraFix | null>(null);
  refused = $state.raw<CameraFix | null>(null);

  constructor(station: Station) {
    this.#station = station;
    this.#fetched = new Fetched(() => this.#read());
  }

  /** For effects. */
  follow(robot: string): () => void {
    void this.#station.revision('fixes', robot);
    if (robot !== this.#robot) {
      this.newest = this.refused = null;
      this.#robot = robot;
    }
    return this.#fetched.follow(robot);
  }

  async #read(): Promise<readonly CameraFix[]> {
    const robot = this.#robot;
    const start = rfc3339(this.#station.now - BACK_MS);
    const { fixes } = await this.#station.api.camera.fixes(robot, { start });
    if (robot !== this.#robot) return fixes;
    const taken = fixes.findLast(({ quality }) => quality !== 'refused') ?? this.newest;
    const refused = fixes.findLast(({ quality }) => quality === 'refused') ?? null;
    this.newest = taken;
    this.refused = isAfter(refused, taken) ? refused : null;
    return fixes;
  }
}

function isAfter(one: CameraFix | null, other: CameraFix | null): boolean {
  if (one === null || other === null) return one !== null;
  return Date.parse(one.measured_at) > Date.parse(other.measured_at);
}
