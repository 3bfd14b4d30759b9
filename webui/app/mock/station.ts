import type {
  Alarm,
  Command,
  CommandLevel,
  Job,
  Json,
  JsonObject,
  LiveRobot,
  LiveTick,
  StationEvent,
} from '../src/api/types';
import { isObject } from '../src/form/schema';
import { FakeControl } from './control';
import { FakeLinks } from './link';
import { FakeMaps } from './map';
import { FakePursuitPlan } from './pursuit_plan';
import { FakeSurvey } from './survey';
import { LAKE_TRACKING } from './track_schema';
import type { FakeFlight } from './transfer';
import { FakeRobot, iso, LAKE, TANK } from './robot';
import { KINDS } from './schema';

/** Everything the fake station knows; speaks the shapes of the real one. */
export class FakeStation {
  readonly started = Date.now();
  readonly speed = Number(process.env.MOCK_SPEED ?? 1);
  robots = [
    new FakeRobot('mini-1', 'Miniglider', 'Identified in the tank.', 1, TANK),
    new FakeRobot('mini-2', 'Miniglider', 'Identified in the tank.', 3, TANK),
    new FakeRobot('grace-1', 'GRACE 3', 'Scaled, not identified.', 2, LAKE),
  ];
  readonly control = new FakeControl(this);
  readonly links = new FakeLinks(this);
  readonly maps = new FakeMaps(this);
  surveys: FakeSurvey[] = [];
  pursuits: FakePursuitPlan[] = [];
  commands = new Map<string, Command>();
  events: StationEvent[] = [];
  alarms: Alarm[] = [];
  jobs = new Map<string, Job>();
  configs = new Map<string, { id: number; value: JsonObject; at: string; by: string }>();
  isSignedIn = process.env.MOCK_SIGNED_OUT !== '1';
  #cursor = 100;

  constructor() {
    this.note('station.started', 'The station started.', null);
    this.note('link.live', 'mini-1 is heard by XBee.', 'mini-1');
    this.note('link.submerged', 'grace-1 dived; radio does not reach it under water.', 'grace-1');
    this.note('config.changed', 'anna changed planner of mini-1.', 'mini-1');
    if (process.env.MOCK_ALARM === '1') this.raise();
    this.configs.set('tracking grace-1', {
      id: 3,
      value: LAKE_TRACKING,
      at: iso(this.started),
      by: 'anna',
    });
    if (process.env.MOCK_TRACK) this.#beginTracking(process.env.MOCK_TRACK);
  }

  get flights(): FakeFlight[] {
    return [...this.surveys, ...this.pursuits];
  }

  /** Let both waters have a robot that follows its target for a while already. */
  #beginTracking(how: string): void {
    for (const robot of this.robots.filter(({ id }) => id !== 'mini-2')) {
      const AGO_MS = robot.site.kind === 'tank' ? 95_000 : 480_000;
      const { value } = this.config('tracking', robot.id);
      const barrier: JsonObject = how === 'teaching' ? { controller: 'nominal' } : {};
      const plan = this.pursue(robot, patched(value, { barrier }), this.started - AGO_MS);
      plan.send(this.started - AGO_MS - 4000, false);
      plan.begin(this.started - AGO_MS);
      plan.step(this.started - 25_000);
      if (plan.pursuit) plan.pursuit.isQuiet = how === 'lost';
      plan.step(this.started);
    }
  }

  pursue(robot: FakeRobot, config: JsonObject, nowMs: number): FakePursuitPlan {
    const note = (text: string, kind: string) => this.note(kind, text, robot.id);
    const made = new FakePursuitPlan(robot, 70 + this.pursuits.length, config, nowMs, note);
    this.pursuits.push(made);
    return made;
  }

  now(): number {
    return this.started + (Date.now() - this.started) * this.speed;
  }

  robot(id: string): FakeRobot | undefined {
    return this.robots.find((robot) => robot.id === id);
  }

  note(
    kind: string,
    text: string,
    robot: string | null,
    level: StationEvent['level'] = 'info',
  ): void {
    this.events.push({
      cursor: ++this.#cursor,
      at: iso(this.now()),
      kind,
      level,
      robot,
      text,
      data: null,
    });
  }

  raise(): void {
    const text = 'Battery 11.1 V is under the limit of 11.2 V.';
    this.alarms.push({
      id: `alarm-${this.alarms.length + 1}`,
      robot: 'grace-1',
      level: 'warning',
      text,
      state: 'unacknowledged',
      raised_at: iso(this.now() - 240_000),
      acknowledged_at: null,
      acknowledged_by: null,
      cleared_at: null,
    });
    this.note('alarm.raised', text, 'grace-1', 'warning');
  }

  command(robot: FakeRobot, kind: string): string {
    const id = `command-${this.commands.size + 1}`;
    const levels: CommandLevel[] = [];
    const name = `The order to ${robot.id} (${kind})`;
    const command: Command = {
      id,
      robot: robot.id,
      kind,
      level: 'created',
      levels,
      created_at: iso(this.now()),
      expires_at: iso(this.now() + 600_000),
      text: `${name} is written down; no link has taken it yet.`,
    };
    this.commands.set(id, command);
    const isSurfacing = kind !== 'quiet' && kind !== 'ping';
    const prove = (level: CommandLevel['level'], text: string, afterMs: number) =>
      setTimeout(() => {
        levels.push({ level, at: iso(this.now()), carrier: 'xbee', reason: '' });
        Object.assign(command, { level, text });
        this.note(`command.${level}`, text, robot.id);
        if (level !== 'applied') return;
        if (isSurfacing) robot.surfacedAt = kind === 'resume' ? null : this.now();
        else if (robot.pursuit) robot.pursuit.isQuiet = kind === 'quiet';
      }, afterMs);
    prove('queued', `${name}: the radio took it; no answer yet.`, 300);
    prove('radio', `${name}: delivered to its radio; no answer yet.`, 1500);
    prove(
      'applied',
      isSurfacing ? `${robot.id} obeys: it is coming up.` : `${robot.id} obeys.`,
      3000,
    );
    return id;
  }

  survey(robot: FakeRobot, config: JsonObject, automation: boolean): FakeSurvey {
    const note = (text: string, kind: string) => this.note(kind, text, robot.id);
    const survey = new FakeSurvey(
      robot,
      this.surveys.length + 1,
      config,
      automation,
      this.now(),
      note,
    );
    this.surveys.push(survey);
    return survey;
  }

  importJob(): Job {
    const job: Job = {
      id: `job-${this.jobs.size + 1}`,
      kind: 'import',
      state: 'running',
      progress: 0,
      message: 'reading rows',
      result: null,
      created_at: iso(this.now()),
    };
    this.jobs.set(job.id, job);
    const timer = setInterval(() => {
      job.progress += 0.1;
      job.message = `${Math.round(job.progress * 5044)} of 5,044 rows`;
      if (job.progress < 0.999) return;
      clearInterval(timer);
      job.state = 'done';
      job.result = {
        deployment: 'eva035',
        rows: 5042,
        skipped: [
          { line: 812, reason: 'depth is not a number' },
          { line: 2377, reason: 'time is before the row above' },
        ],
        skipped_rows: 2,
        without_map: [],
        scores: [],
      };
    }, 300);
    return job;
  }

  config(kind: string, robot: string): { id: number; value: JsonObject; at: string; by: string } {
    const key = `${kind} ${robot}`;
    const known = this.configs.get(key) ?? {
      id: 3,
      value: KINDS[kind]?.value ?? {},
      at: iso(this.started),
      by: 'anna',
    };
    this.configs.set(key, known);
    return known;
  }

  patch(kind: string, robot: string, change: JsonObject): void {
    const known = this.config(kind, robot);
    this.configs.set(`${kind} ${robot}`, {
      id: known.id + 1,
      value: patched(known.value, change),
      at: iso(this.now()),
      by: 'anna',
    });
  }

  /** One robot as the live stream tells it. */
  live(robot: FakeRobot): LiveRobot {
    const links = this.links.of(robot);
    const told = robot.live(this.now());
    const [radio] = links;
    const space = links.find(({ kind, is_plugged }) => kind === 'satellite' && is_plugged);
    const best = radio?.state === 'stale' && space ? space : null;
    const link = best ? { ...told.link, carrier: best.carrier, state: best.state } : told.link;
    return { ...told, link, links };
  }

  tick(after: number): LiveTick {
    const now = this.now();
    for (const pursuit of this.pursuits) pursuit.step(now);
    for (const survey of this.surveys) survey.step(now);
    for (const robot of this.robots) robot.frames += 3;
    const plans = [
      ...this.surveys.flatMap((survey) => survey.plans),
      ...this.pursuits.map(({ plan }) => plan),
    ];
    return {
      at: iso(now),
      cursor: this.#cursor,
      robots: Object.fromEntries(this.robots.map((robot) => [robot.id, this.live(robot)])),
      events: this.events.filter((event) => event.cursor > after),
      plans: Object.fromEntries(
        plans.map(({ id, state, progress, ladder, onboard, stage }) => [
          id,
          {
            state,
            progress,
            ladder,
            onboard,
            stage: stage ?? null,
            transfer: this.links.transfers.of(id),
          },
        ]),
      ),
      missions: Object.fromEntries(
        this.surveys.map(({ mission: { id, state, budget, plan_id, message } }) => [
          id,
          { state, budget: { ...budget }, plan_id, message },
        ]),
      ),
      jobs: Object.fromEntries(this.jobs),
      alarms: {
        unacknowledged: this.alarms.filter(({ acknowledged_at: at }) => at === null).length,
      },
    };
  }
}

function patched(value: JsonObject, change: JsonObject): JsonObject {
  const result = { ...value };
  for (const [key, part] of Object.entries(change)) {
    const known: Json | undefined = result[key];
    result[key] = isObject(known) && isObject(part) ? patched(known, part) : part;
  }
  return result;
}
