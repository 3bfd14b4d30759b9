import type { Plan } from '../../api/types';
import { PlanWatch } from '../../live/plan_watch.svelte';
import type { Station } from '../../live/station.svelte';
import type { Outline } from './account.svelte';

/** How far apart ends of legs may lie that are the same, m: what rounding leaves. */
const SAME_M = 0.01;

/** The plan that was made of a design to try it, and whether the design is still that. */
export class Trial {
  /** Plan that was just asked for. */
  asked = $state.raw<string | null>(null);
  readonly watch: PlanWatch;
  readonly #newest: () => string | null;
  readonly #outline: () => Outline | null;

  /**
   * @param newest plan that was made last of any version
   * @param outline the design on the screen as the station laid it out; `null` until it has
   */
  constructor(station: Station, newest: () => string | null, outline: () => Outline | null) {
    this.watch = new PlanWatch(station);
    this.#newest = newest;
    this.#outline = outline;
  }

  readonly planId = $derived.by(() => this.asked ?? this.#newest());
  readonly plan = $derived.by((): Plan | null => this.watch.plan);

  /** Whether the design on the screen is what was tried; `null` while nobody can tell. */
  readonly isCurrent = $derived.by((): boolean | null => {
    const [plan, outline] = [this.plan, this.#outline()];
    return plan === null || outline === null ? null : hasLegs(outline, plan);
  });

  /** The tried plan where it tells of the design on the screen. */
  readonly shown = $derived.by((): Plan | null => (this.isCurrent ? this.plan : null));

  /** Follow the plan until the returned function is called; for effects. */
  follow(): () => void {
    return this.watch.follow(this.planId);
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
