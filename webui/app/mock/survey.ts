import type {
  FlownPoint,
  Leg,
  Mission,
  Ned,
  Plan,
  PlanPoint,
  PlanState,
  Rehearsal,
  RunnerUp,
  Site,
} from '../src/api/types';
import { SCORES } from './field';
import { iso, type FakeRobot } from './robot';
import { KINDS } from './schema';

const PLANNING_S = 8;
const REHEARSING_S = 4;

function fakeLegs(site: Site, turned = 0): Leg[] {
  const { domain } = site;
  const at = (n: number, e: number, d: number): Ned => [
    domain.x_min_m + (domain.x_max_m - domain.x_min_m) * n,
    domain.y_min_m + (domain.y_max_m - domain.y_min_m) * e,
    domain.depth_max_m * d,
  ];
  const stops: [Leg['kind'], Ned][] = [
    ['glide', at(0.35, 0.3 + turned, 0.8)],
    ['glide', at(0.6, 0.5 - turned, 0)],
    ['dive', at(0.6, 0.5 - turned, 0.9)],
    ['dive', at(0.6, 0.5 - turned, 0)],
    ['swim', at(0.8, 0.3 + turned, 0)],
    ['glide', at(0.65, 0.75, 0.85)],
    ['spiral', at(0.55, 0.75, 0)],
    ['swim', at(0.3, 0.85, 0)],
    ['glide', at(0.12, 0.5, 0.7)],
    ['glide', at(0.2, 0.2, 0)],
  ];
  let start = at(0.1, 0.1, 0);
  return stops.map(([kind, end]) => {
    const length = Math.hypot(end[0] - start[0], end[1] - start[1], end[2] - start[2]);
    const radius = (domain.y_max_m - domain.y_min_m) * 0.1;
    const leg: Leg = {
      kind,
      start_ned: start,
      end_ned: end,
      speed_m_s: 0.02,
      duration_s: length / (site.kind === 'tank' ? 0.03 : 0.25),
      energy: kind === 'dive' ? 1 : kind === 'swim' ? 2.4 : 1.5,
      heading_rad: 0.6,
      radius_m: kind === 'spiral' ? radius : 0,
      turn_rad: kind === 'spiral' ? 7.2 : 0,
    };
    start = end;
    return leg;
  });
}

/** The promised track: the position grows uncertain under water and certain again at a fix. */
function fakePoints(legs: readonly Leg[], scale: number): PlanPoint[] {
  const points: PlanPoint[] = [];
  let t = 0;
  let variance = 0;
  for (const leg of legs) {
    const steps = 8;
    for (let i = 0; i < steps; i++) {
      const share = i / steps;
      const [n, e, d] = leg.start_ned.map((v, c) => v + ((leg.end_ned[c] ?? v) - v) * share) as [
        number,
        number,
        number,
      ];
      variance =
        d < 0.02 * scale
          ? 1e-4 * scale ** 2
          : variance + (leg.duration_s / steps) * 0.0006 * scale ** 2;
      points.push([t + leg.duration_s * share, n, e, d, Math.sqrt(variance)]);
    }
    t += leg.duration_s;
  }
  return points;
}

function fakeRehearsal(points: readonly PlanPoint[], scale: number): Rehearsal {
  const flown = points.map(([t, n, e, d, std], i): FlownPoint => {
    const off = std * 0.8 * Math.sin(i / 9);
    return [t * 1.04, n + off, e - off * 0.6, Math.max(0, d * 0.97), std * 1.1];
  });
  return {
    state: 'done', completed: true, rms_error_m: 0.11 * scale, worst_error_m: 0.24 * scale,
    surfacing_error_m: 0.13 * scale, duration_s: (flown.at(-1)?.[0] ?? 0), energy: 19.6, flown,
    position_error_m: 0.13 * scale, predicted_error_m: 0.14 * scale, within_share: 0.92, runs: 3,
    message: 'The rehearsal completed every leg.',
  }; // prettier-ignore
}

/** A survey whose planning, sending and flying take a few seconds each. */
export class FakeSurvey {
  plans: Plan[] = [];
  mission: Mission;
  #planningSince = 0;
  #rehearsingSince = 0;
  readonly #ended: (text: string, kind: string) => void;

  constructor(
    readonly robot: FakeRobot,
    readonly number: number,
    config: Mission['config'],
    automation: boolean,
    nowMs: number,
    onEvent: (text: string, kind: string) => void,
  ) {
    this.#ended = onEvent;
    this.mission = {
      id: `mission-${number}`,
      robot: robot.id,
      kind: 'adaptive_survey',
      state: 'planning',
      automation,
      config: { ...KINDS.planner?.value, ...config },
      config_id: 'config-3',
      rounds: [],
      budget: { total: 80, spent: 0, round: 20 },
      plan_id: null,
      scores: null,
      message: '',
      created_at: iso(nowMs),
      map_std: 0.41,
      target_std: 0.2,
      exploitation: 0.2,
      ahead: null,
    };
    robot.missionId = this.mission.id;
    this.#beginPlan(nowMs);
  }

  get plan(): Plan | undefined {
    return this.plans.at(-1);
  }

  #beginPlan(nowMs: number): void {
    this.#planningSince = nowMs;
    const round = this.plans.length + 1;
    const plan: Plan = {
      id: `plan-${this.number * 10 + round + 3}`,
      robot: this.robot.id,
      kind: 'adaptive_survey',
      mission_id: this.mission.id,
      round,
      state: 'planning',
      sha256: null,
      config_id: 'config-3',
      config: this.mission.config,
      trim_id: null,
      rehearsal: null,
      stage: 'searching',
      created_at: iso(nowMs),
      legs: [],
      points: [],
      account: null,
      objective: null,
      objective_unit: 'nats',
      violations: [],
      progress: { elapsed_s: 0, seconds_left: PLANNING_S, objective: null, candidates: 0 },
      history: [],
      runners_up: [],
      message: '',
      ladder: {
        draft_at: null,
        sent_at: null,
        on_board_at: null,
        running_at: null,
        ended_at: null,
      },
      onboard: null,
    };
    this.plans.push(plan);
    this.mission.plan_id = plan.id;
    this.mission.rounds.push({
      round,
      plan_id: plan.id,
      state: 'planning',
      energy: 0,
      objective: null,
    });
    this.robot.planId = plan.id;
  }

  step(nowMs: number): void {
    const { plan } = this;
    if (plan?.state === 'planning') this.#search(plan, nowMs);
    if (plan?.stage === 'rehearsing') this.#rehearse(plan, nowMs);
    if (plan?.state === 'running') this.#fly(plan, nowMs);
  }

  #search(plan: Plan, nowMs: number): void {
    const elapsed = (nowMs - this.#planningSince) / 1000;
    const objective = 41.3 * (1 - Math.exp(-Math.floor(elapsed * 2) / 3)) || null;
    const candidates = Math.round(elapsed * 6120);
    plan.progress = {
      elapsed_s: elapsed,
      seconds_left: PLANNING_S - elapsed,
      objective,
      candidates,
    };
    if (objective) plan.history = [...plan.history, { elapsed_s: elapsed, objective, candidates }];
    if (elapsed < PLANNING_S) return;
    plan.progress = null;
    this.#lay(plan, fakeLegs(this.robot.site));
    const t = plan.points.at(-1)?.[0] ?? 0;
    plan.objective = objective;
    plan.sha256 = '3fa91c07be5d24668a1b0c9e7d5f2238a90b1c6d4e8f70123456789abcdef012';
    plan.account = {
      energy: 18.9, duration_s: t, worst_std_m: 0.274, bytes: 412, credits: 0, surfacings: 6,
      satellite_bytes: 600,
    }; // prettier-ignore
    plan.runners_up = [40.9, 40.2, 39.8].map((value, i): RunnerUp => {
      const legs = fakeLegs(this.robot.site, 0.08 * (i + 1));
      return {
        objective: value, energy: 19.4 - i * 0.6, duration_s: t - i * 14, worst_std_m: 0.26 + i * 0.01,
        legs, points: fakePoints(legs, this.#scale),
      };
    }); // prettier-ignore
    plan.message = 'Found in 8.0 s; the last 3.1 s brought nothing better.';
    this.#enter(plan, 'draft', nowMs);
    this.mission.state = 'ready';
    if (plan.round > 1 && this.mission.automation) this.send(nowMs);
  }

  get #scale(): number {
    return this.robot.site.kind === 'tank' ? 1 : 25;
  }

  #lay(plan: Plan, legs: Leg[]): void {
    plan.legs = legs;
    plan.points = fakePoints(legs, this.#scale);
    plan.rehearsal = { ...fakeRehearsal([], 0), state: 'working', completed: false, message: '' };
    plan.stage = 'rehearsing';
    this.#rehearsingSince = this.#planningSince + PLANNING_S * 1000;
  }

  #rehearse(plan: Plan, nowMs: number): void {
    if (nowMs - this.#rehearsingSince < REHEARSING_S * 1000) return;
    plan.rehearsal = fakeRehearsal(plan.points, this.#scale);
    plan.stage = null;
  }

  /** A runner-up takes the draft's place. */
  choose(which: number, nowMs: number): string {
    const old = this.plan;
    const other = old?.runners_up[which];
    if (!old || !other) return old?.id ?? '';
    this.#enter(old, 'superseded', nowMs);
    this.#beginPlan(nowMs - PLANNING_S * 1000);
    const plan = this.plan;
    Object.assign(plan, { ...old, id: plan.id, objective: other.objective, progress: null });
    this.#lay(plan, other.legs ?? []);
    this.#enter(plan, 'draft', nowMs);
    return plan.id;
  }

  searchOn(nowMs: number): string {
    if (this.plan) this.#enter(this.plan, 'superseded', nowMs);
    this.#beginPlan(nowMs);
    return this.plan?.id ?? '';
  }

  /** Let the plan be on its way; by satellite it arrives when it arrives. */
  send(nowMs: number, isRadio = true): void {
    const { plan } = this;
    if (plan?.state !== 'draft') return;
    this.mission.state = 'running';
    this.#enter(plan, 'sent', nowMs);
    if (isRadio) this.arrive(nowMs);
  }

  /** It did not arrive: a draft again. */
  unsend(): void {
    const { plan } = this;
    if (plan?.state !== 'sent') return;
    plan.state = 'draft';
    plan.message = 'Not confirmed on board: its time ran out.';
    plan.ladder = { ...plan.ladder, sent_at: null };
    this.mission.state = 'ready';
  }

  arrive(nowMs: number): void {
    const { plan } = this;
    if (!plan) return;
    setTimeout(() => this.#enter(plan, 'on_board', nowMs + 1500), 1500);
    setTimeout(() => this.#enter(plan, 'running', nowMs + 2500), 2500);
  }

  #fly(plan: Plan, nowMs: number): void {
    const begun = Date.parse(plan.ladder.running_at ?? iso(nowMs));
    const share = Math.min(1, (nowMs - begun) / 60_000);
    const leg = Math.min(plan.legs.length, 1 + Math.floor(share * plan.legs.length));
    plan.onboard = { leg, legs: plan.legs.length, energy_used: share * 18.9 };
    this.mission.budget.spent = (plan.round - 1) * 18.9 + share * 18.9;
    this.robot.plan = {
      plan_id: plan.id,
      sha256: plan.sha256,
      state: 'running',
      leg,
      legs: plan.legs.length,
      age_s: 0.4,
    };
    this.mission.map_std = 0.41 - 0.05 * (plan.round - 1 + share);
    this.mission.exploitation = 0.1 + 0.15 * (plan.round - 1);
    this.mission.ahead = share > 0.4 && plan.round < 4 ? `${plan.id}-ahead` : null;
    this.robot.roundText = `round ${plan.round} of 4`;
    if (share < 1) return;
    this.#enter(plan, 'done', nowMs);
    if (plan.round === 4) {
      this.mission.state = 'done';
      this.mission.scores = SCORES;
    } else {
      this.mission.state = 'replanning';
      this.#beginPlan(nowMs);
    }
  }

  cancel(nowMs: number): void {
    if (this.plan) this.#enter(this.plan, 'cancelled', nowMs);
    this.mission.state = 'stopped';
  }

  #enter(plan: Plan, state: PlanState, nowMs: number): void {
    plan.state = state;
    const rungs: Partial<Record<PlanState, keyof Plan['ladder']>> = {
      draft: 'draft_at',
      sent: 'sent_at',
      on_board: 'on_board_at',
      running: 'running_at',
    };
    plan.ladder = { ...plan.ladder, [rungs[state] ?? 'ended_at']: iso(nowMs) };
    const round = this.mission.rounds.at(-1);
    if (round)
      Object.assign(round, { state, objective: plan.objective, energy: plan.account?.energy });
    this.#ended(`${plan.id} is ${state.replace('_', ' ')}.`, `plan.${state}`);
  }
}
