import { describe, expect, test, vi } from 'vitest';
import type { Api } from '../api/client';
import { Problem } from '../api/problem';
import { nodeAt } from '../form/draft.svelte';
import { KindForm } from './kind_form.svelte';

const SCHEMA = {
  type: 'object',
  properties: {
    speed: { type: 'number', default: 1 },
    areas: { type: 'array', items: {}, default: [] },
  },
};

async function loaded(): Promise<KindForm> {
  const value = { speed: 2, areas: [] };
  const api = {
    configSchema: vi.fn().mockResolvedValue(SCHEMA),
    config: vi.fn().mockResolvedValue({ value: { value, preset: { speed: 1, areas: [] } } }),
  } as unknown as Api;
  const form = new KindForm(api, { members: ['areas'], hint: 'Look at the map.' });
  await form.load('planner', 'mini-1');
  return form;
}

function refused(path: string[]): Problem {
  return new Problem(422, 'Refused', 'One field is wrong.', [{ path, message: 'too fast' }]);
}

function type(form: KindForm, speed: number): void {
  const node = form.draft && nodeAt(form.draft.tree, ['speed']);
  if (node) form.draft?.set(node, speed);
}

describe('a form that a plan is asked for with', () => {
  test('keeps what was asked with once the station took it', async () => {
    const form = await loaded();
    type(form, 3);
    const asked = vi.fn().mockResolvedValue(undefined);
    await form.ask(({ patch }) => asked(patch) as Promise<void>);
    expect(asked).toHaveBeenCalledWith({ speed: 3 });
    expect(form.draft?.isChanged).toBe(false);
    expect(form.refusal).toBe('');
  });

  test('says why it was refused until something is changed', async () => {
    const form = await loaded();
    await form.ask(() => Promise.reject(new Problem(409, 'Refused', 'The robot is silent.')));
    expect(form.refusal).toBe('The robot is silent.');
    type(form, 4);
    expect(form.refusal).toBe('');
    expect(form.draft?.isChanged).toBe(true);
  });

  test('shows a refusal beside its field, and hints at one that is shown elsewhere', async () => {
    const form = await loaded();
    await form.ask(() => Promise.reject(refused(['speed'])));
    const node = form.draft && nodeAt(form.draft.tree, ['speed']);
    expect(node && form.draft?.error(node)).toBe('too fast');
    expect(form.refusal).toBe('');
    await form.ask(() => Promise.reject(refused(['areas', '0'])));
    expect(form.refusal).toBe('Look at the map.');
  });
});
