import { describe, expect, test, vi } from 'vitest';
import type { PlanListing } from '../api/types';
import type { Station } from './station.svelte';
import { besideHand, WaitingDraft } from './waiting_draft.svelte';

function plan(number: number, more: Partial<PlanListing> = {}): PlanListing {
  return {
    id: `plan-${number}`,
    robot: 'mini-1',
    kind: 'track_target',
    state: 'draft',
    mission_id: null,
    round: 1,
    sha256: null,
    account: null,
    objective: null,
    objective_unit: '',
    violations: 0,
    message: '',
    teaches: false,
    created_at: `2026-11-21T04:00:0${number}Z`,
    ladder: {
      draft_at: null,
      sent_at: null,
      on_board_at: null,
      running_at: null,
      ended_at: null,
      waiting_at: null,
    },
    ...more,
  };
}

describe('a draft that waits', () => {
  test('is the newest of its kind among those that the station keeps', async () => {
    const plans = vi
      .fn()
      .mockResolvedValue([plan(4, { kind: 'adaptive_survey' }), plan(2), plan(3), plan(1)]);
    const station = { plans: {}, api: { plans } } as unknown as Station;
    const waiting = new WaitingDraft(station, 'mini-1', 'track_target');
    expect(waiting.newest).toBeNull();
    await waiting.refresh();
    expect(plans).toHaveBeenCalledWith('mini-1', 'draft');
    expect(waiting.newest?.id).toBe('plan-3');
  });

  test('is seen beside an older plan of its kind, or any of another kind', () => {
    const [older, newer] = [plan(1), plan(2)];
    expect(besideHand(newer, null, null)).toBe(newer);
    expect(besideHand(newer, older.id, older)).toBe(newer);
    expect(besideHand(older, newer.id, newer)).toBeNull();
    expect(besideHand(newer, newer.id, newer)).toBeNull();
    const survey = plan(3, { kind: 'adaptive_survey' });
    expect(besideHand(older, survey.id, survey)).toBe(older);
    expect(besideHand(plan(4, { state: 'sent' }), null, null)).toBeNull();
    expect(besideHand(null, null, null)).toBeNull();
  });

  test('stays in sight while it is fetched as what the robot has in hand', () => {
    const [older, newer] = [plan(1), plan(2)];
    expect(besideHand(newer, newer.id, null)).toBe(newer);
    expect(besideHand(newer, older.id, null)).toBeNull();
  });
});
