import type { Tag } from '../api/types';

interface Dot {
  x: number;
  at: number;
  isDoubtful: boolean;
}

interface Abacus {
  spanMs: number;
  ticks: { at: number; x: number }[];
  rows: { tag: string; dots: Dot[] }[];
}

const MINUTE_MS = 60_000;
const STEPS_MIN = [1, 5, 10, 30, 60, 180, 360, 720, 1440, 2880, 10_080, 43_200, 129_600, 525_600];
const TICK_PX = 90;

/** Places the detections of tags between two edges, px, by their times. */
export function abacus(tags: readonly Tag[], left: number, right: number): Abacus {
  const first = Math.min(...tags.map((tag) => Date.parse(tag.first_at)));
  const last = Math.max(...tags.map((tag) => Date.parse(tag.last_at)));
  if (!Number.isFinite(first)) return { spanMs: 0, ticks: [], rows: [] };
  const spanMs = Math.max(last - first, MINUTE_MS);
  const toX = (at: number) => left + ((at - first) / spanMs) * (right - left);
  return {
    spanMs,
    ticks: ticks(first, first + spanMs, (right - left) / TICK_PX).map((at) => ({
      at,
      x: toX(at),
    })),
    rows: tags.map(({ tag, first_at: began, hours, doubts }) => ({
      tag,
      dots: hours.map((hour, i) => {
        const at = Date.parse(began) + hour * 60 * MINUTE_MS;
        return { at, x: toX(at), isDoubtful: doubts[i] ?? false };
      }),
    })),
  };
}

function ticks(from: number, to: number, most: number): number[] {
  const fits = (step: number) => (to - from) / (step * MINUTE_MS) <= Math.max(1, most);
  const step = (STEPS_MIN.find(fits) ?? STEPS_MIN.at(-1) ?? 1) * MINUTE_MS;
  const found: number[] = [];
  for (let at = Math.ceil(from / step) * step; at <= to; at += step) found.push(at);
  return found;
}
