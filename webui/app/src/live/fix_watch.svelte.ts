import { CameraApi } from '../api/camera';
import type { CameraFix } from '../api/types';
import { rfc3339 } from '../text/time';
import { Fetched } from './fetched.svelte';
import type { Station } from './station.svelte';

/** So far back fixes are asked for, ms of station time: a few of the newest. */
const BACK_MS = 2000;

/** The newest fix of a robot by cameras, and the newest that was refused after it. */
export class FixWatch {
  readonly #station: Station;
  readonly #api: CameraApi;
  readonly #fetched: Fetched<readonly CameraFix[]>;
  #robot = '';
  newest = $state.raw<CameraFix | null>(null);
  refused = $state.raw<CameraFix | null>(null);
  /** When one was sent to the robot last; the station notes it a little after the fix. */
  sentAt = $state.raw<string | null>(null);

  constructor(station: Station) {
    this.#station = station;
    this.#api = station.api.part(CameraApi);
    this.#fetched = new Fetched(() => this.#read());
  }

  /** For effects. */
  follow(robot: string): () => void {
    void this.#station.revision('fixes', robot);
    if (robot !== this.#robot) {
      this.newest = this.refused = this.sentAt = null;
      this.#robot = robot;
    }
    return this.#fetched.follow(robot);
  }

  async #read(): Promise<readonly CameraFix[]> {
    const robot = this.#robot;
    const start = rfc3339(this.#station.now - BACK_MS);
    const { fixes } = await this.#api.fixes(robot, { start });
    if (robot !== this.#robot) return fixes;
    const taken = fixes.findLast(({ quality }) => quality !== 'refused') ?? this.newest;
    const refused = fixes.findLast(({ quality }) => quality === 'refused') ?? null;
    this.newest = taken;
    this.refused = isAfter(refused, taken) ? refused : null;
    this.sentAt = fixes.findLast(({ sent_at }) => sent_at !== null)?.sent_at ?? this.sentAt;
    return fixes;
  }
}

function isAfter(one: CameraFix | null, other: CameraFix | null): boolean {
  if (one === null || other === null) return one !== null;
  return Date.parse(one.measured_at) > Date.parse(other.measured_at);
}
