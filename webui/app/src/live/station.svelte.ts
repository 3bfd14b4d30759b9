import { Api } from '../api/client';
import type { Catalogue } from '../part/gauge';
import { Problem, sentence } from '../api/problem';
import type {
  Alarm,
  Alarms,
  Command,
  Fault,
  Health,
  Job,
  LiveRobot,
  LiveBatch,
  Mission,
  Plan,
  Robot,
  Session,
  StationEvent,
  Transfer,
} from '../api/types';
import { StationClock } from './clock';
import { takenFromAddress } from './address_word';
import { Fetched } from './fetched.svelte';
import { FrameQueue } from './frame_queue';
import { LastContact } from './last_contact';
import { Leases } from './lease.svelte';
import { isAtLeast, pilotsAny, roleFor, whyNotPilot } from './right';
import { LiveSocket } from './socket';

const KEPT_EVENTS = 400;
const CLOCK_STEP_MS = 250;
const QUIET_S = 3;
const RETRY_MS = 2000;

/** One robot as the live stream tells it; replaced as a whole, so readers see one moment. */
export class RobotLive {
  report = $state.raw<LiveRobot | null>(null);
  /** Local `performance.now()` of the report, from which its ages go on counting. */
  receivedAt = $state.raw(0);
}

/** Takes a batch of the live stream; `isFirst` of a connection, which tells all that is known. */
export type BatchReader = (batch: LiveBatch, isFirst: boolean) => void;

/** Everything the app knows of the station, kept current by the live stream. */
export class Station {
  readonly api = new Api();
  readonly clock = new StationClock();
  /** Who is in charge of which robot, and whether automation is held. */
  readonly leases = new Leases(this.api, () => this.session?.is_link === false);

  /** `undefined` while the station is being asked, `null` when nobody is signed in. */
  session = $state.raw<Session | null | undefined>(undefined);
  health = $state.raw<Health | null>(null);
  /** Why the station cannot be used at all, in words; `null` while it can. */
  outage = $state.raw<string | null>(null);

  readonly #robots = new Fetched(() => this.#readRobots());
  readonly robots = $derived.by((): readonly Robot[] => this.#robots.value ?? []);
  /** Whether the station has said which robots it has. */
  readonly hasRobots = $derived.by(() => this.#robots.value !== null);
  readonly live = $state<Record<string, RobotLive>>({});
  plans = $state.raw<Readonly<Record<string, Partial<Plan>>>>({});
  missions = $state.raw<Readonly<Record<string, Partial<Mission>>>>({});
  jobs = $state.raw<Readonly<Record<string, Job>>>({});
  commands = $state.raw<Readonly<Record<string, Command>>>({});
  transfers = $state.raw<Readonly<Record<string, Transfer>>>({});
  events = $state.raw<readonly StationEvent[]>([]);
  readonly #alarms = new Fetched(() => this.#readAlarms());
  readonly alarms = $derived.by((): readonly Alarm[] => this.#alarms.value?.alarms ?? []);
  /** How many alarms are open; more than are listed where there are very many. */
  readonly alarmCount = $derived.by(() => this.#alarms.value?.total ?? 0);
  /** Whether the station has said which alarms stand. */
  readonly hasAlarms = $derived.by(() => this.#alarms.value !== null);
  readonly #channels = new Fetched(() => this.api.channel.channels());
  /** Every channel that the station knows, by key, in the order of a screen. */
  readonly channels = $derived.by((): Catalogue =>
    Object.fromEntries((this.#channels.value ?? []).map((one) => [one.key, one])),
  );
  readonly #faults = new Fetched(() => this.#readFaults());
  /** What may be caused in simulated robots, and what was; empty where there is no demo. */
  readonly faults = $derived.by((): readonly Fault[] => this.#faults.value ?? []);
  unacknowledged = $state.raw(0);

  /** Local time that ages and countdowns are read at; moves in steps. */
  localNow = $state.raw(performance.now());
  #lastTickAt = $state.raw<number | null>(null);
  /** Newest revision of what REST tells, as the live stream says it. */
  readonly #revisions = $state<Record<string, number>>({});
  /** Events of the log by the first word of their kind, such as `deployment`, and by robot. */
  readonly #logged = $state<Record<string, number>>({});
  /** Grows when the stream was interrupted: what changed meanwhile is not known. */
  #interruptions = $state.raw(0);
  #isFirst = false;
  #hasOpened = false;
  // eslint-disable-next-line svelte/prefer-svelte-reactivity -- nothing on the screen shows it
  readonly #readers = new Set<BatchReader>();

  readonly #batches = new FrameQueue<LiveBatch>((ticks) =>
    ticks.forEach((tick) => this.#take(tick)),
  );
  readonly #contact = new LastContact();
  readonly #socket: LiveSocket;
  #clockwork: ReturnType<typeof setInterval> | undefined;
  #unfollow: (() => void) | undefined;

  constructor() {
    this.api.onSignedOut = () => this.#leave();
    this.#socket = new LiveSocket({
      onTick: (tick) => this.#batches.put(tick),
      onOpen: () => this.#opened(),
      onClose: (isRefused) => {
        if (isRefused) void this.begin();
      },
    });
  }

  /** Seconds since the station last said anything; `null` before its first word. */
  readonly silence = $derived(
    this.#lastTickAt === null ? null : Math.max(0, (this.localNow - this.#lastTickAt) / 1000),
  );
  /** Whether the live stream has told of the robots. */
  readonly hasTold = $derived(this.#lastTickAt !== null);
  readonly isLive = $derived(this.silence !== null && this.silence < QUIET_S);
  /** It said something once and says nothing now: everything shown is what was known last. */
  readonly isSilent = $derived(this.silence !== null && !this.isLive);
  /** Station time, ms since 1970. */
  readonly now = $derived(this.clock.at(this.localNow));
  /** Whether somebody may pilot any robot at all; the station refuses others by itself. */
  readonly mayPilotAny = $derived.by(() => pilotsAny(this.session));

  /** Why these pages send nothing at all now, one sentence; empty while they do. */
  whyNothingIsSent = (): string => '';

  /** Whether this person may pilot a robot from here now; without one, the station as a whole. */
  mayPilot(robot: string | null): boolean {
    return this.hasPilotRight(robot) && this.whyNothingIsSent() === '';
  }

  /** Whether this person has the right of a pilot, also while the pages show the past. */
  hasPilotRight(robot: string | null): boolean {
    return isAtLeast(roleFor(this.session, robot), 'pilot');
  }

  /** Whether this person may administer a robot; without one, the station as a whole. */
  mayAdminister(robot: string | null): boolean {
    return isAtLeast(roleFor(this.session, robot), 'admin') && this.whyNothingIsSent() === '';
  }

  /** Why this person may not pilot a robot, or the whole station, one sentence; else empty. */
  whyNotPilot(robot: string | null): string {
    return this.whyNothingIsSent() || this.whyNoPilot(robot);
  }

  /** Why this person has not the right of a pilot, also while the pages show the past. */
  whyNoPilot(robot: string | null): string {
    const name = robot === null ? null : (this.robot(robot)?.name ?? robot);
    return whyNotPilot(this.session, robot, name);
  }

  /** Why this person can send a robot nothing now, one sentence; empty where they can. */
  whyNotSend(robot: string): string {
    return this.whyNotPilot(robot) || (this.leases.of(robot)?.refusal ?? '');
  }

  /** Ask who is signed in and, when someone is, start the live stream. */
  async begin(): Promise<void> {
    try {
      this.#setHealth(await this.api.health());
      const secret = takenFromAddress('look');
      if (secret !== null) await this.api.openLink(secret);
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
    this.#clockwork = setInterval(() => (this.localNow = performance.now()), CLOCK_STEP_MS);
    const all = [this.#robots, this.#alarms, this.#channels, this.#faults, this.leases];
    const stop = all.map((one) => one.follow());
    this.#unfollow = () => stop.forEach((end) => end());
    this.#socket.open();
  }

  async signOut(): Promise<void> {
    await this.api.signOut();
    this.#leave();
  }

  robot(id: string): Robot | null {
    return this.robots.find((robot) => robot.id === id) ?? null;
  }

  /** The newest transfer of a plan: as the live stream tells it, or as it came with the plan. */
  transferOf(plan: Plan | null): Transfer | null {
    const known = Object.values(this.transfers).filter(({ plan_id }) => plan_id === plan?.id);
    const all = plan?.transfer ? [plan.transfer, ...known] : known;
    return all.reduce<Transfer | null>(
      (newest, one) => (newest === null || one.started_at >= newest.started_at ? one : newest),
      null,
    );
  }

  /** Age now, s of station time, of something that was `ageS` old when the report came. */
  ageNow(entry: RobotLive, ageS: number): number {
    return ageS + this.clock.since(entry.receivedAt, this.localNow);
  }

  /**
   * A value that changes whenever REST may tell something new of a resource; for effects.
   *
   * @param resource As the station marks it, or as the log's events begin with it.
   * @param robot Whose; none for what belongs to the whole station.
   */
  revision(resource: string, robot?: string): string {
    const key = robot === undefined ? resource : `${resource}/${robot}`;
    const logged = this.#logged[key] ?? 0;
    return `${this.#interruptions} ${this.#revisions[key] ?? 0} ${logged}`;
  }

  /** Whether the station has ever marked a resource. */
  isMarked(resource: string): boolean {
    return resource in this.#revisions;
  }

  #count(resource: string, robot: string | null): void {
    for (const key of [resource, `${resource}/${robot ?? ''}`]) {
      this.#logged[key] = (this.#logged[key] ?? 0) + 1;
    }
  }

  /** Hand every batch of the live stream to a reader until the returned function is called. */
  onBatch(reader: BatchReader): () => void {
    this.#readers.add(reader);
    return () => this.#readers.delete(reader);
  }

  async acknowledge(alarm: Alarm, note = ''): Promise<void> {
    await this.onAlarms(() => this.api.alarm.acknowledge(alarm, note));
  }

  /** Do something about an alarm, and read them all again. */
  async onAlarms(action: () => Promise<unknown>): Promise<void> {
    try {
      await action();
    } finally {
      await this.#alarms.load();
    }
  }

  #leave(): void {
    this.#stop();
    this.session = null;
  }

  #stop(): void {
    this.#socket.close();
    this.#batches.clear();
    clearInterval(this.#clockwork);
    this.#unfollow?.();
    this.#lastTickAt = null;
    this.#hasOpened = false;
  }

  #setHealth(health: Health): void {
    this.health = health;
    this.clock.speed = health.clock.speed;
    if (!this.isLive) this.clock.set(Date.parse(health.clock.now), performance.now());
  }

  /** Ask for the robots anew, for example since one was given another model. */
  refresh(): Promise<void> {
    return this.#robots.load();
  }

  async #readRobots(): Promise<readonly Robot[]> {
    const robots = await this.api.robots();
    for (const robot of robots) this.live[robot.id] ??= new RobotLive();
    return robots;
  }

  /** Ask for the alarms, and for what is wrong with the station itself. */
  async #readAlarms(): Promise<Alarms> {
    const [alarms, health] = await Promise.all([this.api.alarm.list(), this.api.health()]);
    this.#setHealth(health);
    return alarms;
  }

  async #readFaults(): Promise<readonly Fault[]> {
    return this.health?.demo ? this.api.demo.faults() : [];
  }

  #opened(): void {
    if (this.#hasOpened) {
      this.#interruptions++;
      this.#robots.follow();
      this.#alarms.follow();
      this.#channels.follow();
      this.#faults.follow();
      this.leases.follow();
    }
    this.#isFirst = this.#hasOpened = true;
  }

  #take(tick: LiveBatch): void {
    const [isFirst, at] = [this.#isFirst, performance.now()];
    this.#isFirst = false;
    this.localNow = at;
    this.#lastTickAt = at;
    this.#contact.note();
    this.clock.set(Date.parse(tick.at), at);
    for (const [id, report] of Object.entries(tick.robots)) this.#takeRobot(id, report, at);
    this.plans = merged(this.plans, tick.plans);
    this.missions = merged(this.missions, tick.missions);
    this.jobs = merged(this.jobs, tick.jobs);
    this.commands = merged(this.commands, tick.commands);
    this.transfers = merged(this.transfers, tick.transfers);
    Object.assign(this.#revisions, tick.changed);
    for (const { kind, robot } of tick.events) this.#count(kind.split('.')[0] ?? '', robot);
    if (tick.events.length) {
      this.events = [...this.events, ...tick.events].slice(-KEPT_EVENTS);
    }
    this.unacknowledged = tick.alarms.unacknowledged;
    if ('robots' in tick.changed) this.#robots.follow();
    if ('alarms' in tick.changed) this.#alarms.follow();
    if ('channels' in tick.changed) this.#channels.follow();
    if ('demo' in tick.changed) this.#faults.follow();
    this.leases.take(tick.changed);
    for (const reader of this.#readers) reader(tick, isFirst);
  }

  #takeRobot(id: string, report: LiveRobot, at: number): void {
    const entry = (this.live[id] ??= new RobotLive());
    entry.report = report;
    entry.receivedAt = at;
  }
}

/** Names what a person sees of an alarm: raised anew, or worse, it is another. */
export function occurrence({ id, raised_at, level }: Alarm): string {
  return `${id} ${raised_at} ${level}`;
}

export function isUnacknowledged(state: Alarm['state']): boolean {
  return state === 'unacknowledged' || state === 'returned';
}

/** Whether an alarm stands aside: shelved, suppressed by design, or its rule out of service. */
export function isParked(state: Alarm['state']): boolean {
  return state === 'shelved' || state === 'suppressed' || state === 'out_of_service';
}

/** Records with the changed members of some of them taken over; untouched records stay the same. */
export function merged<T extends object>(
  known: Readonly<Record<string, T>>,
  changed: Readonly<Record<string, Partial<T>>>,
): Readonly<Record<string, T>> {
  const changes = Object.entries(changed);
  if (changes.length === 0) return known;
  const result: Record<string, T> = { ...known };
  for (const [id, change] of changes) {
    result[id] = { ...(result[id] ?? ({} as T)), ...change };
  }
  return result;
}
