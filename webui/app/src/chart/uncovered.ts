/** A rectangle on the screen, px. */
export interface Box {
  left: number;
  top: number;
  width: number;
  height: number;
}

/**
 * Which of its places each thing takes so that none covers another, or what is drawn already: the
 * first that is free, an earlier thing before a later one; null where none is free.
 */
export function uncovered<Place extends Box>(
  things: readonly (readonly Place[])[],
  drawn: readonly Box[] = [],
): (Place | null)[] {
  const kept: Box[] = [...drawn];
  return things.map((places) => {
    const free = places.find((place) => !kept.some((other) => overlap(place, other)));
    if (free) kept.push(free);
    return free ?? null;
  });
}

function overlap(a: Box, b: Box): boolean {
  return (
    a.left < b.left + b.width &&
    b.left < a.left + a.width &&
    a.top < b.top + b.height &&
    b.top < a.top + a.height
  );
}
