import type { Plan, PlanListing } from '../api/types';
import { Fetched } from './fetched.svelte';
import type { Station } from './station.svelte';

/** The newest draft of one kind that waits for a robot, also while the robot has another plan. */
export class WaitingDraft {
  readonly #station: Station;
  readonly #kind: string;
  readonly #drafts: Fetched<readonly PlanListing[]>;

  constructor(station: Station, robot: string, kind: string) {
    this.#station = station;
    this.#kind = kind;
    this.#drafts = new Fetched(() => station.api.plans(robot, 'draft'));
  }

  readonly newest = $derived.by(() => newestDraft(this.#drafts.value ?? [], this.#kind));

  /** Whether the station has said which drafts wait. */
  readonly isKnown = $derived.by(() => this.#drafts.value !== null);

  readonly refusal = $derived.by(() => this.#drafts.refusal);

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
    return this.#drafts.follow();
  }
}

function newestDraft(plans: readonly PlanListing[], kind: string): PlanListing | null {
  const [newest] = plans
    .filter((plan) => plan.state === 'draft' && plan.kind === kind)
    .toSorted((a, b) => b.created_at.localeCompare(a.created_at));
  return newest ?? null;
}

/**
 * The draft that is to be looked at beside what the robot has in hand, if it is to be.
 *
 * A newer plan of the same kind in hand has taken its place; one of another kind has not. While
 * that plan is still being fetched nobody knows, unless it is this draft itself: then it stays in
 * sight, with whatever is opened of it.
 */
export function besideHand<Draft extends Pick<Plan, 'id' | 'kind' | 'state' | 'created_at'>>(
  draft: Draft | null,
  handId: string | null,
  hand: Pick<Plan, 'id' | 'kind' | 'created_at'> | null,
): Draft | null {
  if (draft?.state !== 'draft') return null;
  if (hand === null) return handId === null || handId === draft.id ? draft : null;
  if (hand.id === draft.id) return null;
  return hand.kind !== draft.kind || hand.created_at < draft.created_at ? draft : null;
}
