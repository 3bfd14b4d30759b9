import { describe, expect, test, vi } from 'vitest';
import { Problem, wholeSentence } from '../api/problem';
import { Errand } from './errand.svelte';
import { Fetched } from './fetched.svelte';
import type { Station } from './station.svelte';

const REFUSED = new Problem(409, 'Refused', 'The radio is not live.');

describe('what is read from the station', () => {
  test('stays on the screen when it cannot be read again', async () => {
    const read = vi.fn().mockResolvedValueOnce([1]).mockRejectedValueOnce(REFUSED);
    const source = new Fetched<number[]>(read);
    await source.load();
    await source.load();
    expect(source.value).toEqual([1]);
    expect(source.refusal).toBe('The radio is not live.');
  });

  test('is the answer to the last question, not the last answer', async () => {
    const answers: ((value: string) => void)[] = [];
    const source = new Fetched(() => new Promise<string>((tell) => answers.push(tell)));
    const both = [source.load(), source.load()];
    answers[1]?.('new');
    answers[0]?.('old');
    await Promise.all(both);
    expect(source.value).toBe('new');
  });

  test('does not wipe away why something was not done', async () => {
    const source = new Fetched(() => Promise.resolve(1));
    expect(await source.after(() => Promise.reject(REFUSED))).toBe(false);
    await source.load();
    expect(source.refusal).toBe('The radio is not live.');
    expect(await source.after(() => Promise.resolve())).toBe(true);
    expect(source.refusal).toBe('');
  });
});

describe('an errand', () => {
  const station = (state: string, message: string) =>
    ({
      api: { job: () => Promise.resolve({ id: 'job-1', state, message }) },
    }) as unknown as Station;

  test('that is done tells what came of it', async () => {
    const errand = new Errand(station('done', 'Asking.'), () => 'All were told.');
    await errand.begin(() => Promise.resolve({ job: 'job-1' }));
    await vi.waitFor(() => expect(errand.outcome).toBe('All were told.'));
    expect(errand.hasFailed).toBe(false);
  });

  test('that failed tells why', async () => {
    const errand = new Errand(station('failed', 'The robot fell silent.'), () => 'Never.');
    await errand.begin(() => Promise.resolve({ job: 'job-1' }));
    await vi.waitFor(() => expect(errand.outcome).toBe('The robot fell silent.'));
    expect(errand.hasFailed).toBe(true);
  });

  test('that was begun before is picked up, with the time at which it ended', async () => {
    const ended_at = '2026-11-21T04:00:00Z';
    const job = { id: 'job-7', state: 'failed', message: 'The radio was lost.', ended_at };
    const known = { api: { job: vi.fn().mockResolvedValue(job) } } as unknown as Station;
    const errand = new Errand(known, () => 'Never.');
    errand.resume('job-7', '/flight.log');
    await vi.waitFor(() => expect(errand.outcome).toBe('The radio was lost.'));
    expect(known.api.job).toHaveBeenCalledWith('job-7');
    expect(errand.subject).toBe('/flight.log');
    expect(errand.endedAt).toBe(ended_at);
    await errand.begin(() => Promise.reject(REFUSED));
    expect(errand.endedAt).toBeNull();
  });

  test('that was refused is not under way', async () => {
    const errand = new Errand(station('done', ''), () => 'Never.');
    await errand.begin(() => Promise.reject(REFUSED));
    expect(errand.refusal).toBe('The radio is not live.');
    expect(errand.isRunning).toBe(false);
  });
});

test('a refusal can name its fields where no form does', () => {
  const problem = new Problem(422, 'Refused', '1 field is wrong.', [
    { path: ['password'], message: 'enter it again' },
  ]);
  expect(wholeSentence(problem)).toBe('1 field is wrong. password: enter it again');
});
