import { render } from 'svelte/server';
import { describe, expect, test, vi } from 'vitest';
import type { Plan } from '../api/types';
import EmptyState from '../part/EmptyState.svelte';
import { MissionWatch, PlanWatch } from './plan_watch.svelte';
import type { Station } from './station.svelte';

const NONE = { title: 'No plan yet', text: 'Plan one.' };

describe('what the station has not said yet', () => {
  test('is never told as if there were none', () => {
    const asking = render(EmptyState, { props: { ...NONE, isKnown: false } }).body;
    expect(asking).toContain('Asking the station.');
    expect(asking).not.toContain('No plan yet');
    expect(render(EmptyState, { props: { ...NONE, isKnown: true } }).body).toContain('No plan yet');
  });

  test('holds for a plan until it has come, and says why it does not', async () => {
    const answers: ((plan: Plan) => void)[] = [];
    const plan = vi
      .fn()
      .mockRejectedValueOnce(new Error('gone'))
      .mockImplementation(() => new Promise<Plan>((tell) => answers.push(tell)));
    const watch = new PlanWatch({ plans: {}, api: { plan } } as unknown as Station);
    expect(watch.isKnown(null)).toBe(true);
    vi.useFakeTimers();
    const leave = watch.follow('plan-6');
    expect(watch.isKnown('plan-6')).toBe(false);
    await vi.advanceTimersByTimeAsync(1500);
    expect(watch.refusal).not.toBe('');
    answers[0]?.({ id: 'plan-6', state: 'running' } as Plan);
    await vi.advanceTimersByTimeAsync(10);
    expect(watch.isKnown('plan-6')).toBe(true);
    expect(watch.isKnown('plan-7')).toBe(false);
    expect(watch.refusal).toBe('');
    leave();
    vi.useRealTimers();
  });

  test('holds for a mission until it has come', async () => {
    const mission = vi.fn().mockResolvedValue({ id: 'mission-2' });
    const station = { missions: {}, revision: () => '', api: { mission } } as unknown as Station;
    const watch = new MissionWatch(station);
    const leave = watch.follow('mission-2');
    expect(watch.isKnown('mission-2')).toBe(false);
    await vi.waitFor(() => expect(watch.isKnown('mission-2')).toBe(true));
    leave();
  });
});
