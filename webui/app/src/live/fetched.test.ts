import { describe, expect, test, vi } from 'vitest';
import { Problem, wholeSentence } from '../api/problem';
import { Errand } from './errand.svelte';
import { Fetched } from './fetched.svelte';
import { JobWatch } from './job_watch.svelte';
import { Orders } from './order.svelte';
import type { BatchReader, Station } from './station.svelte';
import type { Command, Job, LiveBatch } from '../api/types';

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

  test('is asked for once more when it changes while an answer is under way', async () => {
    vi.useFakeTimers();
    const answers: ((value: number) => void)[] = [];
    const read = vi.fn(() => new Promise<number>((tell) => answers.push(tell)));
    const source = new Fetched(read);
    source.follow();
    for (let change = 0; change < 10; change++) source.follow();
    answers[0]?.(1);
    await vi.advanceTimersByTimeAsync(5000);
    expect(source.value).toBe(1);
    answers[1]?.(2);
    await vi.advanceTimersByTimeAsync(5000);
    expect(source.value).toBe(2);
    expect(read).toHaveBeenCalledTimes(2);
    vi.useRealTimers();
  });

  test('rests between two answers, however often it changes', async () => {
    vi.useFakeTimers();
    const read = vi.fn().mockResolvedValue(1);
    const source = new Fetched<number>(read, 8000);
    for (let second = 0; second < 60; second++) {
      source.follow();
      await vi.advanceTimersByTimeAsync(1000);
    }
    expect(read).toHaveBeenCalledTimes(8);
    vi.useRealTimers();
  });

  test('is asked for again only while that fails, and while somebody looks', async () => {
    vi.useFakeTimers();
    const read = vi.fn().mockRejectedValueOnce(REFUSED).mockResolvedValueOnce(1);
    const source = new Fetched<number>(read);
    source.follow();
    await vi.advanceTimersByTimeAsync(60_000);
    expect(source.value).toBe(1);
    expect(read).toHaveBeenCalledTimes(2);
    read.mockRejectedValue(REFUSED);
    const leave = source.follow();
    await vi.advanceTimersByTimeAsync(1);
    leave();
    await vi.advanceTimersByTimeAsync(60_000);
    expect(read).toHaveBeenCalledTimes(3);
    vi.useRealTimers();
  });
});

describe('a job', () => {
  function followed() {
    const readers = new Set<BatchReader>();
    const onBatch = (reader: BatchReader) => {
      readers.add(reader);
      return () => readers.delete(reader);
    };
    const api = { job: vi.fn().mockResolvedValue({ id: 'job-1', state: 'running', progress: 0 }) };
    const onend = vi.fn();
    const watch = new JobWatch({ api, onBatch } as unknown as Station, onend);
    watch.follow('job-1');
    const tell = (jobs: Record<string, Partial<Job>>, isFirst = false) =>
      readers.forEach((reader) => reader({ jobs } as unknown as LiveBatch, isFirst));
    return { watch, api, onend, readers, tell };
  }

  test('is followed by the live stream, and let go when it ends', async () => {
    const { watch, api, onend, readers, tell } = followed();
    await vi.waitFor(() => expect(watch.isRunning).toBe(true));
    tell({ 'job-1': { state: 'running', progress: 0.5 } });
    expect(watch.job?.progress).toBe(0.5);
    tell({ 'job-1': { state: 'done', progress: 1 } });
    expect(onend).toHaveBeenCalledTimes(1);
    expect(readers.size).toBe(0);
    expect(api.job).toHaveBeenCalledTimes(1);
  });

  test('that the station forgot while it was not heard has ended', async () => {
    const { watch, api, onend, tell } = followed();
    await vi.waitFor(() => expect(watch.isRunning).toBe(true));
    api.job.mockRejectedValue(new Problem(404, 'Unknown', 'There is no job-1.'));
    tell({}, true);
    await vi.waitFor(() => expect(onend).toHaveBeenCalledWith(null));
    expect(watch.isRunning).toBe(false);
    expect(watch.refusal).toContain('The station was started again meanwhile');
  });
});

describe('an order', () => {
  function given(known: Record<string, Partial<Command>> = {}) {
    let read: BatchReader | undefined;
    const onBatch = (reader: BatchReader) => {
      read = reader;
      return () => undefined;
    };
    const command = (level: string) => ({ id: 'command-1', level, levels: [{ level }] });
    const api = {
      command: vi.fn().mockResolvedValue({ id: 'command-1' }),
      commandState: vi.fn().mockResolvedValue(command('expired')),
    };
    const orders = new Orders({ api, onBatch, commands: known } as unknown as Station);
    orders.follow();
    const tell = (levels: string[]) =>
      levels.forEach((level) =>
        read?.({ commands: { 'command-1': command(level) } } as unknown as LiveBatch, false),
      );
    const reconnect = () => read?.({ commands: {} } as LiveBatch, true);
    const level = () => orders.byRobot['mini-1']?.command?.level;
    return { orders, api, tell, reconnect, level };
  }

  test('is followed by the live stream alone', async () => {
    const { orders, api, tell, level } = given();
    await orders.give('mini-1', 'surface');
    expect(orders.byRobot['mini-1']).toMatchObject({ id: 'command-1', command: null });
    tell(['created', 'queued', 'radio', 'applied']);
    expect(level()).toBe('applied');
    expect(api.commandState).not.toHaveBeenCalled();
  });

  test('that the stream told before the station answered is known at once', async () => {
    const { orders, api, level } = given({ 'command-1': { id: 'command-1', level: 'queued' } });
    await orders.give('mini-1', 'surface');
    expect(level()).toBe('queued');
    expect(api.commandState).not.toHaveBeenCalled();
  });

  test('is not forgotten for an earlier one that the station answers later', async () => {
    const { orders, api } = given();
    let answer: ((taken: { id: string }) => void) | undefined;
    api.command.mockReturnValueOnce(new Promise((tell) => (answer = tell)));
    const earlier = orders.give('mini-1', 'hold');
    await orders.give('mini-1', 'surface');
    answer?.({ id: 'command-0' });
    await earlier;
    expect(orders.byRobot['mini-1']).toMatchObject({ kind: 'surface', id: 'command-1' });
  });

  test('that the stream does not tell any more is asked for when it comes back', async () => {
    const { orders, api, reconnect, level } = given();
    await orders.give('mini-1', 'surface');
    reconnect();
    await vi.waitFor(() => expect(level()).toBe('expired'));
    reconnect();
    expect(api.commandState).toHaveBeenCalledTimes(1);
  });
});

describe('an errand', () => {
  const station = (state: string, message: string) =>
    ({
      api: { job: () => Promise.resolve({ id: 'job-1', state, message }) },
      onBatch: () => () => undefined,
    }) as unknown as Station;

  test('that is done tells what came of it', async () => {
    const errand = new Errand(station('done', 'Asking.'), () => 'All were told.');
    await errand.begin(() => Promise.resolve({ id: 'job-1' }));
    await vi.waitFor(() => expect(errand.outcome).toBe('All were told.'));
    expect(errand.hasFailed).toBe(false);
  });

  test('that failed tells why', async () => {
    const errand = new Errand(station('failed', 'The robot fell silent.'), () => 'Never.');
    await errand.begin(() => Promise.resolve({ id: 'job-1' }));
    await vi.waitFor(() => expect(errand.outcome).toBe('The robot fell silent.'));
    expect(errand.hasFailed).toBe(true);
  });

  test('that was begun before is picked up, with the time at which it ended', async () => {
    const ended_at = '2026-11-21T04:00:00Z';
    const job = { id: 'job-7', state: 'failed', message: 'The radio was lost.', ended_at };
    const api = { job: vi.fn().mockResolvedValue(job) };
    const known = { api, onBatch: () => () => undefined } as unknown as Station;
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
