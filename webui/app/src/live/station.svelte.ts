import { Api } from '../api/client';
import { Problem, sentence } from '../api/problem';
import type {
  Alarm,
  Health,
  Job,
  LiveRobot,
  LiveBatch,
  Mission,
  Plan,
  Robot,
  Session,
  StationEvent,
} from '../api/types';
import { StationClock } from './clock';
import { LiveSocket } from './socket';

const KEPT_EVENTS = 400;
const CLOCK_STEP_MS = 250;
const ROBOTS_EVERY_MS = 10_000;
const QUIET_S = 3;
const RETRY_MS = 2000;

/** One robot as the live stream tells it; replaced as a whole, so readers see one moment. */
export class RobotLive {
  report = $state.raw<LiveRobot | null>(null);
  /** Local `performance.now()` of the report, from which its ages go on counting. */
  receivedAt = $state.raw(0);
}

/** Everything the app knows of the station, kept current by the live stream. */
export class Station {
  readonly api = new Api();
  readonly clock = new StationClock();

  /** `undefined` while the station is being asked, `null` when nobody is signed in. */
  session = $state.raw<Session | null | undefined>(undefined);
  health = $state.raw<Health | null>(null);
  /** Why the station cannot be used at all, in words; `null` while it can. */
  outage = $state.raw<string | null>(null);

  robots = $state.raw<readonly Robot[]>([]);
  readonly live = $state<Record<string, RobotLive>>({});
  plans = $state.raw<Readonly<Record<string, Partial<Plan>>>>({});
  missions = $state.raw<Readonly<Record<string, Partial<Mission>>>>({});
  jobs = $state.raw<Readonly<Record<string, Partial<Job>>>>({});
  events = $state.raw<readonly StationEvent[]>([]);
  alarms = $state.raw<readonly Alarm[]>([]);
  unacknowledged = $state.raw(0);

  /** Local time that ages and countdowns are read at; moves in steps. */
  localNow = $state.raw(performance.now());
  #lastTickAt = $state.raw<number | null>(null);

  readonly #socket: LiveSocket;
  #timers: ReturnType<typeof setInterval>[] = [];

  constructor() {
    this.api.onSignedOut = () => this.#leave();
    this.#socket = new LiveSocket({
      onTick: (tick) => this.#take(tick),
      onOpen: () => void this.refresh(),
      onClose: (isRefused) => {
        if (isRefused) void this.begin();
      },
    });
  }

  /** Seconds since the station last said anything; `null` before its first word. */
  readonly silence = $derived(
    this.#lastTickAt === null ? null : Math.max(0, (this.localNow - this.#lastTickAt) / 1000),
  );
  readonly isLive = $derived(this.silence !== null && this.silence < QUIET_S);
  /** It said something once and says nothing now: everything shown is what was known last. */
  readonly isSilent = $derived(this.silence !== null && !this.isLive);
  /** Station time, ms since 1970. */
  readonly now = $derived(this.clock.at(this.localNow));
  readonly mayCommand = $derived(this.session?.role === 'pilot' || this.session?.role === 'admin');

  /** Ask who is signed in and, when someone is, start the live stream. */
  async begin(): Promise<void> {
    try {
      this.#setHealth(await this.api.health());
      this.session = await this.api.session();
      this.outage = null;
    } catch (error) {
      if (error instanceof Problem && error.status === 401) this.#leave();
      else {
        this.outage = sentence(error);
        setTimeout(() => void this.begin(), RETRY_MS);
      }
      return;
    }
    this.#stop();
    this.#timers = [
      setInterval(() => (this.localNow = performance.now()), CLOCK_STEP_MS),
      setInterval(() => void this.refresh(), ROBOTS_EVERY_MS),
    ];
    await this.refresh();
    this.#socket.open();
  }

  async signOut(): Promise<void> {
    await this.api.signOut();
    this.#leave();
  }

  robot(id: string): Robot | null {
    return this.robots.find((robot) => robot.id === id) ?? null;
  }

  /** Age now, s of station time, of something that was `ageS` old when the report came. */
  ageNow(entry: RobotLive, ageS: number): number {
    return ageS + this.clock.since(entry.receivedAt, this.localNow);
  }

  async acknowledge(alarm: Alarm): Promise<void> {
    await this.api.acknowledge(alarm.id);
    await this.#refreshAlarms();
  }

  #leave(): void {
    this.#stop();
    this.session = null;
  }

  #stop(): void {
    this.#socket.close();
    this.#timers.forEach(clearInterval);
    this.#timers = [];
    this.#lastTickAt = null;
  }

  #setHealth(health: Health): void {
    this.health = health;
    this.clock.speed = health.clock.speed;
    if (!this.isLive) this.clock.set(Date.parse(health.clock.now), performance.now());
  }

  /** Ask for what the live stream does not carry: robots, health, alarms. */
  async refresh(): Promise<void> {
    try {
      const [robots, health] = await Promise.all([this.api.robots(), this.api.health()]);
      for (const robot of robots) this.live[robot.id] ??= new RobotLive();
      this.robots = robots;
      this.#setHealth(health);
      await this.#refreshAlarms();
    } catch {
      // The header tells the silence of the station; the next round asks again.
    }
  }

  async #refreshAlarms(): Promise<void> {
    this.alarms = await this.api.alarms();
    this.unacknowledged = this.alarms.filter(({ state }) => isUnacknowledged(state)).length;
  }

  #take(tick: LiveBatch): void {
    const at = performance.now();
    this.localNow = at;
    this.#lastTickAt = at;
    this.clock.set(Date.parse(tick.at), at);
    for (const [id, report] of Object.entries(tick.robots)) this.#takeRobot(id, report, at);
    this.plans = merged(this.plans, tick.plans);
    this.missions = merged(this.missions, tick.missions);
    this.jobs = merged(this.jobs, tick.jobs);
    if (tick.events.length) {
      this.events = [...this.events, ...tick.events].slice(-KEPT_EVENTS);
    }
    if (tick.alarms.unacknowledged !== this.unacknowledged) {
      this.unacknowledged = tick.alarms.unacknowledged;
      void this.#refreshAlarms().catch(() => undefined);
    }
  }

  #takeRobot(id: string, report: LiveRobot, at: number): void {
    const entry = (this.live[id] ??= new RobotLive());
    entry.report = report;
    entry.receivedAt = at;
    if (this.robot(id) === null) void this.refresh();
  }
}

export function isUnacknowledged(state: Alarm['state']): boolean {
  return state === 'unacknowledged' || state === 'returned';
}

/** Records with the changed members of some of them taken over; untouched records stay the same. */
export function merged<T extends object>(
  known: Readonly<Record<string, T>>,
  changed: Readonly<Record<string, Partial<T>>>,
): Record<string, T> {
  const result: Record<string, T> = { ...known };
  for (const [id, change] of Object.entries(changed)) {
    result[id] = { ...(result[id] ?? ({} as T)), ...change };
  }
  return result;
}
