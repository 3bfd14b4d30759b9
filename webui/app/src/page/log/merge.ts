import type { StationEvent } from '../../api/types';

/** Two stretches of events as one, in order, each event once. */
export function mergeEvents(
  known: readonly StationEvent[],
  more: readonly StationEvent[],
): StationEvent[] {
  const byCursor = new Map([...known, ...more].map((event) => [event.cursor, event]));
  return [...byCursor.values()].sort((a, b) => a.cursor - b.cursor);
}

/** Whether an event is of a person ('' for all) and has words in its sentence or kind. */
export function isSought(event: StationEvent, by: string, words: string): boolean {
  const sought = words.toLowerCase();
  const has = (text: string) => text.toLowerCase().includes(sought);
  return (by === '' || event.by === by) && (has(event.text) || has(event.kind));
}
