import type { StationEvent } from '../../api/types';

/** Two stretches of events as one, in order, each event once. */
export function mergeEvents(
  known: readonly StationEvent[],
  more: readonly StationEvent[],
): StationEvent[] {
  const byCursor = new Map<string, StationEvent>();
  for (const event of [...known, ...more]) byCursor.set(String(event.cursor), event);
  return [...byCursor.values()].sort((a, b) => Number(a.cursor) - Number(b.cursor));
}
