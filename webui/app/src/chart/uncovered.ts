/** A rectangle on the screen, px. */
export interface Box {
  left: number;
  top: number;
  width: number;
  height: number;
}

/** Which boxes can be shown so that none covers another; an earlier one goes before. */
export function uncovered(boxes: readonly Box[]): boolean[] {
  const kept: Box[] = [];
  return boxes.map((box) => {
    if (kept.some((other) => overlap(box, other))) return false;
    kept.push(box);
    return true;
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
