import { expect, it } from 'vitest';
import { answerOf } from './line';

function stream(...parts: string[]): ReadableStream<Uint8Array> {
  const bytes = parts.map((part) => new TextEncoder().encode(part));
  return new ReadableStream({
    start(control) {
      for (const part of bytes) control.enqueue(part);
      control.close();
    },
  });
}

it('tells how far the reading is, wherever the lines are cut', async () => {
  const told: number[] = [];
  const cut = stream('{"progress":0.2}\n{"pro', 'gress":0.7}\n{"answer":{"total"', ':3}}\n');
  expect(await answerOf(cut, (share) => told.push(share))).toEqual({ total: 3 });
  expect(told).toEqual([0.2, 0.7]);
});

it('throws what the station says, and what it does not', async () => {
  const refused = stream('{"progress":0.2}\n', '{"problem":"Try again."}\n');
  await expect(answerOf(refused, () => undefined)).rejects.toThrow('Try again.');
  await expect(answerOf(stream('{"progress":0.2}\n'), () => undefined)).rejects.toThrow();
  await expect(answerOf(null, () => undefined)).rejects.toThrow();
});
