import type {
  JsonObject,
  NorthEast,
  TargetHypothesis,
  TrackPhase,
  TrackView,
} from '../src/api/types';
import { numberOf, textOf } from '../src/page/plan/config';
import { ellipse95 } from '../src/chart/ellipse';
import { inverseCondition, kept, pursued } from './pursuit_law';
import { iso } from './robot';

const STEP_S = 0.1;
const REPORT_EVERY_S = 0.5;
/** While the robot has not turned enough, the mirrored place is as likely, s. */
const MIRRORED_S = 14;
const OUTLIER_SHARE = 0.03;

type Pair = [north: number, east: number];

/** A robot that follows a target; its motion is the real law's, its estimate is made up. */
export class FakePursuit {
  readonly reports: TrackView[] = [];
  isQuiet = false;
  endedBecause: string | null = null;
  #at: Pair;
  #heading: number;
  #speed: number;
  #elapsed = 0;
  #sinceRange = 0;
  #sinceFound = 0;
  #lostFor = 0;
  #range: number | null = null;
  #heard = 0;
  #rejected = 0;
  #off: Pair;
  #spread: Pair;
  #phase: TrackPhase = 'waiting';
  #random = 12345;

  constructor(
    readonly name: string,
    readonly config: JsonObject,
    readonly startMs: number,
    start: { north: number; east: number; heading: number },
  ) {
    const guess = this.#number('target', 'guess_std_m');
    this.#at = [start.north, start.east];
    this.#heading = start.heading;
    this.#speed = this.#scale * 0.12;
    this.#off = [0.9 * guess, -0.7 * guess];
    this.#spread = [guess ** 2, guess ** 2];
  }

  /** The lake's numbers are an order above the tank's. */
  get #scale(): number {
    return textOf(this.config, 'target', 'kind') === 'virtual' ? 1 : 2.5;
  }

  #number = (...path: string[]): number => numberOf(this.config, ...path);

  get isBarrierOn(): boolean {
    return textOf(this.config, 'barrier', 'controller') !== 'nominal';
  }

  get phase(): TrackPhase {
    return this.#phase;
  }

  get motion(): { north: number; east: number; heading: number; speed: number } {
    const [north, east] = this.#at;
    return { north, east, heading: this.#heading, speed: this.#speed };
  }

  /** Where the target is, s after the start. */
  target(t: number): Pair {
    const [north, east] = [this.#number('target', 'north_m'), this.#number('target', 'east_m')];
    const heading = this.#number('target', 'heading_rad');
    if (textOf(this.config, 'target', 'kind') !== 'virtual') {
      return [north + 20 * Math.sin(t / 240), east + 26 * Math.sin(t / 310)];
    }
    const radius = this.#number('target', 'width_m');
    const way = this.#number('target', 'speed_m_s') * t;
    if (textOf(this.config, 'target', 'path') === 'static') return [north, east];
    if (textOf(this.config, 'target', 'path') === 'line') {
      return [north + way * Math.cos(heading), east + way * Math.sin(heading)];
    }
    const angle = way / radius;
    return [north + radius * Math.sin(angle), east + radius * (1 - Math.cos(angle))];
  }

  /** Way of a virtual target as the plan tells it. */
  path(durationS: number): [number, number, number][] {
    return Array.from({ length: 61 }, (_, i) => {
      const t = (durationS * i) / 60;
      return [t, ...this.target(t)];
    });
  }

  advance(nowMs: number): void {
    const until = Math.min((nowMs - this.startMs) / 1000, this.#number('motion', 'duration_s'));
    while (this.#elapsed < until - 1e-9 && this.#phase !== 'ended') {
      this.#step();
      if (Math.round(this.#elapsed / STEP_S) % (REPORT_EVERY_S / STEP_S) === 0) this.#report();
    }
    if (this.#phase !== 'ended' && until >= this.#number('motion', 'duration_s')) this.end('');
  }

  end(reason: string): void {
    if (this.#phase === 'ended') return;
    this.#phase = 'ended';
    this.endedBecause = reason;
    this.#report();
  }

  #step(): void {
    this.#elapsed += STEP_S;
    this.#listen();
    const [turn, push] = this.#control().command;
    const middle = this.#heading + (turn * STEP_S) / 2;
    this.#at[0] += this.#speed * Math.cos(middle) * STEP_S;
    this.#at[1] += this.#speed * Math.sin(middle) * STEP_S;
    this.#heading = Math.atan2(
      Math.sin(this.#heading + turn * STEP_S),
      Math.cos(this.#heading + turn * STEP_S),
    );
    const most = this.#number('motion', 'speed_max_m_s');
    const least = this.isBarrierOn ? 0.05 * this.#scale : 0;
    this.#speed = Math.max(least, Math.min(most, this.#speed + push * STEP_S));
    this.#estimate();
  }

  #listen(): void {
    this.#sinceRange += STEP_S;
    this.#sinceFound += STEP_S;
    const period = this.#number('ranging', 'period_s');
    if (!this.isQuiet && this.#sinceRange >= period - 1e-9 && this.#elapsed > 2) {
      this.#heard++;
      if (this.#chance() < OUTLIER_SHARE) this.#rejected++;
      else {
        if (this.#phase === 'lost' || this.#phase === 'waiting') this.#sinceFound = 0;
        this.#range = Math.max(0.01, this.#distance() + 0.05 * this.#normal() * this.#scale);
        this.#sinceRange = 0;
      }
    }
    const silence = this.#sinceRange;
    if (this.#heard === 0) this.#phase = 'waiting';
    else if (silence < this.#number('ranging', 'coast_after_s')) this.#phase = 'tracking';
    else if (silence < this.#number('ranging', 'lost_after_s')) this.#phase = 'coasting';
    else this.#phase = 'lost';
    this.#lostFor = this.#phase === 'lost' ? this.#lostFor + STEP_S : 0;
    const patience = this.#number('ranging', 'give_up_after_s');
    if (this.#lostFor > patience) this.end('its target was lost');
  }

  /** The ellipse grows without ranges and shrinks as well as the course lets it. */
  #estimate(): void {
    const known = inverseCondition(this.#relative(), this.#speed, this.#heading);
    const noise = this.#scale ** 2 * 4e-3;
    const isHearing = this.#sinceRange < 1.5;
    this.#spread = this.#spread.map((variance, i) => {
      const floor = noise * (i === 0 ? 0.6 : 0.6 + 1.2 * Math.exp(-8 * known));
      const rate = isHearing ? 0.25 * (known + 0.02) : 0;
      const growth = isHearing ? 0 : 0.006 * this.#scale ** 2;
      return variance + (growth - rate * (variance - floor)) * STEP_S;
    }) as Pair;
    const drift = this.isBarrierOn ? (isHearing ? 0 : 0.02) : 0.045;
    const heal = isHearing && this.isBarrierOn ? 0.3 * known : 0;
    this.#off = this.#off.map((off, i) => {
      const room = Math.max(0, 1 - Math.hypot(...this.#off) / (1.2 * this.#scale));
      const push = drift * room * this.#scale * (i === 0 ? 1 : -0.6);
      const jitter = 0.025 * this.#scale * this.#normal() * Math.sqrt(STEP_S);
      return off + (push - heal * off) * STEP_S + jitter * (isHearing ? 1 : 0.3);
    }) as Pair;
  }

  #truth(): Pair {
    return this.target(this.#elapsed);
  }

  #believed(): Pair {
    const [north, east] = this.#truth();
    return [north + this.#off[0], east + this.#off[1]];
  }

  /** Robot as seen from where it believes its target to be. */
  #relative(): Pair {
    const [north, east] = this.#believed();
    return [this.#at[0] - north, this.#at[1] - east];
  }

  #distance(): number {
    const [north, east] = this.#truth();
    return Math.hypot(this.#at[0] - north, this.#at[1] - east);
  }

  #control(): ReturnType<typeof kept> {
    const limits = {
      turn: this.#number('motion', 'turn_rate_max_rad_s'),
      push: this.#number('motion', 'acceleration_max_m_s2') * this.#scale,
    };
    if (this.#phase === 'lost') {
      const circle: Pair = [0.6 * limits.turn, 0];
      const state = { relative: this.#relative(), heading: this.#heading, speed: this.#speed };
      const told = kept(state, circle, limits, { level: 1, slope: 1, isOn: false });
      return { ...told, isFeasible: true };
    }
    const state = { relative: this.#relative(), heading: this.#heading, speed: this.#speed };
    const nominal = pursued(state, {
      heading: this.#number('barrier', 'heading_gain_per_s') * (this.#scale === 1 ? 1 : 0.2),
      distance: this.#number('barrier', 'distance_gain_per_s2') * 0.3,
      lead: this.#number('barrier', 'lead_m') * this.#scale,
    });
    const law = {
      level: Math.sqrt(this.#number('barrier', 'epsilon')),
      slope: this.#number('barrier', 'slope'),
      isOn: this.isBarrierOn,
    };
    return kept(state, nominal, limits, law);
  }

  #report(): void {
    const { command, nominal, determinant, barrier, isFeasible } = this.#control();
    const hypotheses = this.#heard === 0 ? [] : this.#hypotheses();
    const isVirtual = textOf(this.config, 'target', 'kind') === 'virtual';
    const truth = this.#truth();
    const at = iso(this.startMs + this.#elapsed * 1000);
    const [first] = hypotheses;
    this.reports.push({
      measured_at: at,
      received_at: at,
      phase: this.#phase,
      position_ne_m: [...this.#at],
      hypotheses,
      range_m: this.#range,
      range_age_s: this.#sinceRange,
      ranges_heard: this.#heard,
      ranges_rejected: this.#rejected,
      determinant_m2_s: determinant,
      barrier,
      inverse_condition: inverseCondition(this.#relative(), this.#speed, this.#heading),
      nominal,
      command,
      is_barrier_on: this.isBarrierOn,
      is_feasible: isFeasible,
      is_quiet: this.isQuiet,
      true_ne_m: isVirtual ? truth : null,
      error_m: isVirtual && first ? distance(first.position_ne_m, truth) : null,
      reason: this.endedBecause ?? '',
      text: this.#text(first),
    });
  }

  #hypotheses(): TargetHypothesis[] {
    const at = this.#believed();
    const sight = Math.atan2(at[1] - this.#at[1], at[0] - this.#at[0]);
    const [along, across] = this.#spread;
    const [c, s] = [Math.cos(sight), Math.sin(sight)];
    const covariance: TargetHypothesis['covariance_m2'] = [
      along * c * c + across * s * s,
      (along - across) * c * s,
      along * s * s + across * c * c,
    ];
    const weight = 0.5 + 0.5 * Math.min(1, this.#sinceFound / MIRRORED_S);
    const own: TargetHypothesis = {
      position_ne_m: at, velocity_ne_m_s: [0, 0], covariance_m2: covariance, weight,
    }; // prettier-ignore
    const hasTwo = textOf(this.config, 'filter', 'hypotheses') !== 'one';
    if (!hasTwo || weight > 0.98) return [{ ...own, weight: 1 }];
    const turned = 2 * this.#heading - sight;
    const away = distance(at, this.#at);
    const mirrored: Pair = [
      this.#at[0] + away * Math.cos(turned),
      this.#at[1] + away * Math.sin(turned),
    ];
    return [own, { ...own, position_ne_m: mirrored, weight: 1 - weight }];
  }

  #text(first: TargetHypothesis | undefined): string {
    const within = first ? (ellipse95(first.covariance_m2)?.longM ?? 0).toPrecision(2) : '?';
    const away = first ? distance(first.position_ne_m, this.#at).toPrecision(3) : '?';
    const quiet = this.isQuiet ? ' (it was told not to ping)' : '';
    switch (this.#phase) {
      case 'waiting':
        return `${this.name} has heard no range of its target yet.`;
      case 'tracking':
        return `${this.name} follows its target, ${away} m away, known within ${within} m.`;
      case 'coasting':
        return `${this.name} goes on by dead reckoning${quiet}; the newest range is ${this.#sinceRange.toFixed(1)} s old, known within ${within} m.`;
      case 'lost':
        return `${this.name} lost its target${quiet}; it circles to find it.`;
      case 'ended':
        return `${this.name} follows its target no longer${this.endedBecause ? `: ${this.endedBecause}` : ''}.`;
    }
  }

  /** The same numbers at every start. */
  #chance(): number {
    this.#random = (this.#random * 1103515245 + 12345) % 2147483648;
    return this.#random / 2147483648;
  }

  #normal(): number {
    return Math.sqrt(-2 * Math.log(this.#chance() + 1e-9)) * Math.cos(6.2832 * this.#chance());
  }
}

function distance(a: NorthEast, b: NorthEast): number {
  return Math.hypot(a[0] - b[0], a[1] - b[1]);
}
