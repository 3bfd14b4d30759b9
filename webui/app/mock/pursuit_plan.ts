import type { JsonObject, Plan, PlanState } from '../src/api/types';
import { isTeaching } from '../src/page/track/config';
import { numberOf } from '../src/page/plan/config';
import { FakePursuit } from './pursuit';
import { iso, type FakeRobot } from './robot';

/** A plan to follow a target: a draft at once, flown as long as it says. */
export class FakePursuitPlan {
  readonly plan: Plan;
  pursuit: FakePursuit | null = null;

  constructor(
    readonly robot: FakeRobot,
    number: number,
    readonly config: JsonObject,
    nowMs: number,
    readonly note: (text: string, kind: string) => void,
  ) {
    const { water } = robot.site;
    const north = numberOf(config, 'target', 'north_m');
    const isInside = north > water.x_min_m && north < water.x_max_m;
    this.plan = {
      id: `plan-${number}`,
      robot: robot.id,
      kind: 'track_target',
      mission_id: null,
      round: 0,
      state: 'draft',
      sha256: 'c07be5d23fa91a1b0c9e7d5f2238a90b1c6d4e8f701234566789abcdef0124668',
      config_id: 'config-3',
      config,
      trim_id: null,
      created_at: iso(nowMs),
      legs: [],
      points: [],
      account: null,
      objective: null,
      objective_unit: '',
      violations: isInside
        ? []
        : [{ field: 'target.north_m', message: 'The target lies outside of the water.' }],
      progress: null,
      history: [],
      runners_up: [],
      message: '',
      ladder: {
        draft_at: iso(nowMs), sent_at: null, on_board_at: null, running_at: null, ended_at: null,
      },
      onboard: null,
      tracking: config,
      teaches: isTeaching(config),
      warnings: isTeaching(config)
        ? [{ field: 'teaching', message: 'Teaching only: without the barrier the estimate goes wrong.' }]
        : [],
    }; // prettier-ignore
    const way = new FakePursuit(robot.id, config, nowMs, { north: 0, east: 0, heading: 0 });
    const isVirtual = JSON.stringify(config).includes('"kind":"virtual"');
    this.plan.target_path = isVirtual ? way.path(numberOf(config, 'motion', 'duration_s')) : [];
    robot.planId = this.plan.id;
  }

  send(nowMs: number, isRadio = true): void {
    if (this.plan.state !== 'draft') return;
    this.#enter('sent', nowMs);
    if (isRadio) this.arrive(nowMs);
  }

  unsend(): void {
    if (this.plan.state !== 'sent') return;
    this.plan.state = 'draft';
    this.plan.ladder = { ...this.plan.ladder, sent_at: null };
  }

  arrive(nowMs: number): void {
    setTimeout(() => this.#enter('on_board', nowMs + 1500), 1500);
    setTimeout(() => this.begin(nowMs + 2500), 2500);
  }

  begin(nowMs: number): void {
    const { ned, heading } = this.robot.motion(nowMs);
    if (this.plan.state !== 'on_board') this.#enter('on_board', nowMs - 1000);
    this.#enter('running', nowMs);
    const [north, east] = ned;
    this.pursuit = new FakePursuit(this.robot.id, this.config, nowMs, { north, east, heading });
    this.robot.pursuit = this.pursuit;
    this.robot.surfacedAt = null;
  }

  step(nowMs: number): void {
    const { pursuit } = this;
    if (!pursuit || this.plan.state !== 'running') return;
    const before = pursuit.phase;
    if (this.robot.surfacedAt !== null) pursuit.end('a person ordered it to surface');
    pursuit.advance(nowMs);
    if (before !== 'lost' && pursuit.phase === 'lost') {
      this.note(`${this.robot.id} lost its target.`, 'track.lost');
    }
    if (pursuit.phase !== 'ended') return;
    this.plan.message = pursuit.endedBecause ? `It ended because ${pursuit.endedBecause}.` : '';
    this.#enter(pursuit.endedBecause ? 'failed' : 'done', nowMs);
  }

  cancel(nowMs: number): void {
    this.#enter('cancelled', nowMs);
  }

  #enter(state: PlanState, nowMs: number): void {
    const rungs: Partial<Record<PlanState, keyof Plan['ladder']>> = {
      sent: 'sent_at',
      on_board: 'on_board_at',
      running: 'running_at',
    };
    this.plan.state = state;
    this.plan.ladder = { ...this.plan.ladder, [rungs[state] ?? 'ended_at']: iso(nowMs) };
    this.note(`${this.plan.id} is ${state.replace('_', ' ')}.`, `plan.${state}`);
  }
}
