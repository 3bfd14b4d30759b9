import { untrack } from 'svelte';
import type { Plan, PlanListing } from '../api/types';
import { Fetched } from './fetched.svelte';
import type { Station } from './station.svelte';

const ASK_EVERY_MS = 10_000;

/** The newest draft of one kind that waits for a robot, also while the robot has another plan. */
export class WaitingDraft {
  readonly #station: Station;
  readonly #kind: string;
  readonly #drafts: Fetched<PlanListing[]>;

  constructor(station: Station, robot: string, kind: string) {
    this.#station = station;
    this.#kind = kind;
    this.#drafts = new Fetched(() => station.api.plans(robot, 'draft'));
  }

  readonly newest = $derived.by(() => newestDraft(this.#drafts.value ?? [], this.#kind));

  /** Which plans the live stream tells of, and in what state: any change is reason to ask. */
  readonly #news = $derived.by(() =>
    Object.entries(this.#station.plans)
      .map(([id, { state = '' }]) => `${id} ${state}`)
      .join(),
  );

  refresh = (): Promise<void> => this.#drafts.load();

  /** Keep it current until the returned function is called; for effects. */
  follow(): () => void {
    void this.#news;
    return untrack(() => this.#drafts.every(ASK_EVERY_MS));
  }
}

function newestDraft(plans: readonly PlanListing[], kind: string): PlanListing | null {
  const [newest] = plans
    .filter((plan) => plan.state === 'draft' && plan.kind === kind)
    .toSorted((a, b) => b.created_at.localeCompare(a.created_at));
  return newest ?? null;
}

/**
 * Whether a draft is to be looked at beside what the robot has in hand.
 *
 * A newer plan of the same kind in hand has taken its place; one of another kind has not.
 */
export function isToBeSeen(
  draft: Pick<Plan, 'id' | 'kind' | 'created_at'>,
  hand: Pick<Plan, 'id' | 'kind' | 'created_at'> | null,
): boolean {
  if (hand === null) return true;
  return hand.id !== draft.id && (hand.kind !== draft.kind || hand.created_at < draft.created_at);
}
