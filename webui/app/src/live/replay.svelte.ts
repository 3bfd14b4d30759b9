import { sentence } from '../api/problem';
import type { LogItem, MomentThen, Timeline, Track } from '../api/types';
import { newKey } from '../api/call';
import { rfc3339 } from '../text/time';
import type { Cursor, ReplayClock } from './cursor.svelte';
import { NewestQuestion } from './newest_question';
import type { Station } from './station.svelte';

const TRACK_POINTS = 5000;
const LOG_LINES = 12;
const MINUTE_MS = 60_000;
/** Without a value for so long there is a gap, ms. */
const GAP_MS = 60_000;
/** The station's clock is known to so much in a browser, ms. */
const CLOCK_MS = 1500;

/** Why nothing is sent while the pages show the past. */
export const NOTHING_SENT =
  'This is a replay: nothing is sent from here but Surface now. Go back to live first.';

interface Question {
  robot: string;
  at: number;
  clock: ReplayClock;
}

/** A moment as the station is asked for it: with all of its millisecond, which it counts more finely. */
function wholeMoment(ms: number): string {
  return rfc3339(ms).replace('Z', '999Z');
}

/** What the pages show of one robot at the moment that the cursor is at. */
export class Replay {
  /** Names this tab to the station, which draws it a 3D view of its own. */
  readonly tab = newKey();
  moment = $state.raw<MomentThen | null>(null);
  /** Lines of the log book until then, the newest first. */
  log = $state.raw<readonly LogItem[]>([]);
  timeline = $state.raw<Timeline | null>(null);
  /** The way through the deployment of the moment, all of it. */
  #way = $state.raw<Track | null>(null);
  refusal = $state.raw('');
  /** Robot and moment of which the 3D view has been drawn; `null` before the first. */
  scene = $state.raw<{ robot: string; at: number } | null>(null);
  sceneRefusal = $state.raw('');
  readonly #moments: NewestQuestion<Question>;
  readonly #scenes: NewestQuestion<Question>;
  readonly #station: Station;

  constructor(
    station: Station,
    readonly cursor: Cursor,
  ) {
    this.#station = station;
    this.#moments = new NewestQuestion((question) => this.#read(question));
    this.#scenes = new NewestQuestion((question) => this.#draw(question));
  }

  /** From where to where the replay runs, ms, before the end itself; `null` before that is known. */
  readonly bounds = $derived.by((): readonly [number, number] | null => {
    const line = this.timeline;
    if (!line) return null;
    const end = line.lasts ? this.#station.now - CLOCK_MS : Date.parse(line.ends_at) - 1;
    return [Date.parse(line.begins_at), Math.max(Date.parse(line.begins_at), end)];
  });

  /** What was known of a robot then; `null` while live, and before the first answer. */
  momentOf(robot: string): MomentThen | null {
    return this.cursor.isReplay && this.moment?.robot === robot ? this.moment : null;
  }

  /** The way of the robot until the moment. */
  readonly track = $derived.by((): Track | null => {
    const [way, at] = [this.#way, this.cursor.at];
    if (way === null || at === null) return null;
    const heard = this.cursor.clock === 'received' ? way.received_at : null;
    return cutTrack(way, (i) => {
      const isHeard = heard === null || Date.parse(heard[i] ?? '') <= at;
      return isHeard && Date.parse(way.measured_at[i] ?? '') <= at;
    });
  });

  /** Whether the robot told nothing around the moment. */
  readonly isInGap = $derived.by(() => {
    const { sample_before: before = null, sample_after: after = null } = this.moment?.beside ?? {};
    if (before === null || after === null || this.cursor.at === null) return false;
    const [from, to] = [Date.parse(before), Date.parse(after)];
    return to - from > GAP_MS && this.cursor.at >= from && this.cursor.at < to;
  });

  /** Follow the cursor for a robot; for effects. */
  follow(robot: string): void {
    const { at, clock } = this.cursor;
    if (at !== null) this.#moments.want({ robot, at, clock });
  }

  /** Let the 3D view of this tab follow the cursor; for effects of who shows it. */
  followScene(robot: string): void {
    const { at, clock } = this.cursor;
    if (at !== null) this.#scenes.want({ robot, at, clock });
  }

  seek(at: number): void {
    this.cursor.seek(at, this.bounds);
  }

  play(): void {
    const { cursor, bounds } = this;
    if (!cursor.isReplay) return;
    if (!cursor.playing && bounds && cursor.at === bounds[1]) cursor.seek(bounds[0]);
    cursor.playing = !cursor.playing;
  }

  /** Go to what lies beside the moment; nothing where nothing does. */
  step(beside: keyof MomentThen['beside']): void {
    const to = this.moment?.beside[beside];
    if (to) this.seek(Date.parse(to));
  }

  /** Obey a key of a replay; tells whether it was one. */
  press(key: string, shift: boolean): boolean {
    const { at } = this.cursor;
    if (at === null) return false;
    const act = REPLAY_KEYS.find((one) => one.key === key && one.shift === shift)?.act;
    act?.(this, at);
    return act !== undefined;
  }

  async #read({ robot, at, clock }: Question): Promise<void> {
    const { api } = this.#station;
    const moment = wholeMoment(at);
    try {
      const [known, log] = await Promise.all([
        api.replay.moment(robot, moment, clock),
        this.#station.session?.is_link
          ? { items: [] }
          : api.logBook.read({ robot, to: moment, limit: LOG_LINES }),
      ]);
      this.moment = known;
      this.log = log.items;
      this.refusal = '';
      if (!this.#isKnown(robot, at)) await this.#readTimeline(robot, moment);
    } catch (error) {
      this.refusal = sentence(error);
    }
  }

  #isKnown(robot: string, at: number): boolean {
    const line = this.timeline;
    if (line?.robot !== robot || line.deployment?.id !== this.moment?.deployment?.id) return false;
    const read = Date.parse(line.ends_at);
    return at >= Date.parse(line.begins_at) && (at <= read || !line.lasts);
  }

  async #readTimeline(robot: string, at: string): Promise<void> {
    const { api } = this.#station;
    const line = await api.replay.timeline(robot, at);
    const stretch = { start: line.begins_at, end: line.ends_at };
    this.#way = await api.track(robot, { ...stretch, max_points: TRACK_POINTS, arrivals: true });
    this.timeline = line;
  }

  async #draw({ robot, at, clock }: Question): Promise<void> {
    try {
      await this.#station.api.replay.moveView(robot, this.tab, wholeMoment(at), clock);
      this.scene = { robot, at };
      this.sceneRefusal = '';
    } catch (error) {
      this.sceneRefusal = sentence(error);
    }
  }
}

/** The points of a track that pass. */
export function cutTrack(way: Track, passes: (index: number) => boolean): Track {
  const kept = way.measured_at.flatMap((_, i) => (passes(i) ? [i] : []));
  const pick = <T>(column: readonly T[]): T[] => kept.map((i) => column[i] as T);
  return {
    ...way,
    measured_at: pick(way.measured_at),
    north_m: pick(way.north_m),
    east_m: pick(way.east_m),
    depth_m: pick(way.depth_m),
    std_m: pick(way.std_m),
    fidelity: pick(way.fidelity),
    adrift: pick(way.adrift),
    latitude_deg: pick(way.latitude_deg),
    longitude_deg: pick(way.longitude_deg),
    received_at: way.received_at && pick(way.received_at),
  };
}

interface ReplayKey {
  key: string;
  shift: boolean;
  /** As the sheet of keys names it. */
  name: string;
  meaning: string;
  act: (replay: Replay, at: number) => void;
}

function key(
  of: string,
  name: string,
  meaning: string,
  act: ReplayKey['act'],
  shift = false,
): ReplayKey {
  return { key: of, shift, name, meaning, act };
}

/** Keys of a replay; none of them sends anything. */
export const REPLAY_KEYS: readonly ReplayKey[] = [
  key(' ', 'Space', 'Play and pause', (replay) => replay.play()),
  key('ArrowLeft', '←', 'One sample back', (replay) => replay.step('sample_before')),
  key('ArrowRight', '→', 'One sample on', (replay) => replay.step('sample_after')),
  key('ArrowLeft', 'Shift ←', 'A minute back', (replay, at) => replay.seek(at - MINUTE_MS), true),
  key('ArrowRight', 'Shift →', 'A minute on', (replay, at) => replay.seek(at + MINUTE_MS), true),
  key('[', '[', 'Event before', (replay) => replay.step('event_before')),
  key(']', ']', 'Event after', (replay) => replay.step('event_after')),
  key('Home', 'Home', 'To the beginning', (replay) => replay.seek(-Infinity)),
  key('End', 'End', 'To the end', (replay) => replay.seek(Infinity)),
];
