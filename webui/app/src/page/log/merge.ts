import type { StationEvent } from '../../api/types';

/** Two stretches of events as one, in order, each event once. */
export function mergeEvents(
  known: readonly StationEvent[],
  more: readonly StationEvent[],
): StationEvent[] {
  const byCursor = new Map([...known, ...more].map((event) => [event.cursor, event]));
  return [...byCursor.values()].sort((a, b) => a.cursor - b.cursor);
}
