import { untrack } from 'svelte';
import type { Api } from '../api/client';
import { append, trim, type Series } from '../chart/series';
import { rfc3339 } from '../text/time';
import type { RobotLive } from './station.svelte';

const POINTS = 1500;

/**
 * The last `spanS` seconds of one channel: loaded once, then kept current from the live stream.
 *
 * An infinite span takes all that there is, as of a recording.
 */
export class ChannelHistory {
  /** Grows with every change of `series`, which itself is changed in place. */
  version = $state.raw(0);
  series: Series = { t: [], v: [] };
  isLoaded = $state(false);

  constructor(
    readonly channel: string,
    readonly spanS: number,
    readonly points = POINTS,
  ) {}

  async load(api: Api, robot: string, nowMs: number, signal: AbortSignal): Promise<void> {
    const start = this.spanS === Infinity ? null : rfc3339(nowMs - this.spanS * 1000);
    try {
      const answer = await api.samples(
        robot,
        { channel: this.channel, start, max_points: this.points },
        signal,
      );
      const t = answer.measured_at.map((at) => Date.parse(at) / 1000);
      const loaded: Series = { t, v: [...answer.value] };
      const last = loaded.t.at(-1) ?? -Infinity;
      const newer = this.series.t.findIndex((at) => at > last);
      if (newer >= 0) {
        loaded.t.push(...this.series.t.slice(newer));
        loaded.v.push(...this.series.v.slice(newer));
      }
      this.series = loaded;
    } catch {
      // Without history the line begins now.
    }
    this.isLoaded = true;
    this.#changed();
  }

  /** Bounds across: the span that ends now, or all of a recording. */
  bounds(nowS: number): [number, number] {
    if (this.spanS !== Infinity) return [nowS - this.spanS, nowS];
    return [this.series.t[0] ?? nowS - 1, this.series.t.at(-1) ?? nowS];
  }

  /** Take the newest value over from a live report. */
  take(entry: RobotLive | undefined): void {
    const channel = entry?.report?.channels[this.channel];
    if (!channel) return;
    const at = Date.parse(channel.measured_at) / 1000;
    if (!append(this.series, at, channel.value, this.spanS / this.points)) return;
    trim(this.series, at - this.spanS);
    this.#changed();
  }

  #changed(): void {
    this.version = untrack(() => this.version) + 1;
  }
}
