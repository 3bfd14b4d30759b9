import type { Plan } from '../../api/types';
import { Fetched } from '../../live/fetched.svelte';
import { PlanWatch } from '../../live/plan_watch.svelte';
import type { Station } from '../../live/station.svelte';
import type { Outline } from './account.svelte';
import { same, type Design, type DesignView } from './document';

/** How far apart ends of legs may lie that are the same, m: what rounding leaves. */
const SAME_M = 0.01;

/** What a trial is judged by: the design on the screen. */
export interface Drawn {
  view: () => DesignView;
  document: () => Design;
  /** The design as the station laid it out; `null` until it has. */
  outline: () => Outline | null;
}

/** The plan that was made of a design to try it, and whether the design is still that. */
export class Trial {
  /** Plan that was just asked for, and what it is of. */
  #asked = $state.raw<{ plan: string; document: Design } | null>(null);
  readonly watch: PlanWatch;
  readonly #drawn: Drawn;
  readonly #version: Fetched<Design | null>;

  constructor(station: Station, drawn: Drawn) {
    this.watch = new PlanWatch(station);
    this.#drawn = drawn;
    this.#version = new Fetched(async () => {
      const newest = this.#newest;
      if (!newest?.plan) return null;
      return (await station.api.design.version(drawn.view().id, newest.number)).document;
    });
  }

  readonly #newest = $derived.by(() => this.#drawn.view().versions[0] ?? null);
  readonly planId = $derived.by(() => this.#asked?.plan ?? this.#newest?.plan ?? null);
  readonly plan = $derived.by((): Plan | null => this.watch.plan);

  /** Whether the design on the screen is what was tried; `null` while nobody can tell. */
  readonly isCurrent = $derived.by((): boolean | null => {
    const tried = this.#asked?.document ?? this.#version.value;
    return this.plan && tried ? same(tried, this.#drawn.document()) : null;
  });

  /**
   * Whether the same design would have other legs now: it is laid out otherwise once the current or
   * the robot's settings are others.
   */
  readonly isOtherNow = $derived.by(() => {
    const [plan, outline] = [this.plan, this.#drawn.outline()];
    return this.isCurrent === true && plan && outline ? !hasLegs(outline, plan) : false;
  });

  /** The tried plan where it tells of the design on the screen. */
  readonly shown = $derived.by((): Plan | null => (this.isCurrent ? this.plan : null));

  /** A plan was asked for. */
  begin(plan: string, document: Design): void {
    this.#asked = { plan, document };
  }

  /** Follow the plan until the returned function is called; for effects. */
  follow(): () => void {
    const number = String(this.#newest?.number ?? '');
    const stop = [this.watch.follow(this.planId), this.#version.follow(number)];
    return () => {
      for (const each of stop) each();
    };
  }
}

/** Whether a design has the legs of a plan. */
export function hasLegs(
  { legs }: { legs: readonly Ends[] },
  plan: { legs: readonly Ends[] },
): boolean {
  return (
    legs.length === plan.legs.length &&
    legs.every(({ kind, start_ned, end_ned }, i) => {
      const other = plan.legs[i];
      return (
        other?.kind === kind &&
        apart(start_ned, other.start_ned) < SAME_M &&
        apart(end_ned, other.end_ned) < SAME_M
      );
    })
  );
}

interface Ends {
  kind: string;
  start_ned: readonly number[];
  end_ned: readonly number[];
}

function apart(a: readonly number[], b: readonly number[]): number {
  return Math.hypot(...a.map((value, i) => value - (b[i] ?? 0)));
}
