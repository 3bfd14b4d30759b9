/** Keys of the page of designs. None of them tells a robot anything. */
import type { DesignEditor } from './editor.svelte';

/** Part of what the map shows that an arrow key moves a place by; ten times as much with Shift. */
const NUDGE_M = { tank: 0.05, open: 1 };

export const DESIGN_KEYS: readonly (readonly [key: string, meaning: string])[] = [
  ['Ctrl Z', 'Undo'],
  ['Ctrl Y', 'Redo'],
  ['Ctrl A', 'Choose all places'],
  ['Del', 'Delete what is chosen'],
  ['← ↑ ↓ →', 'Nudge what is chosen; with Shift ten times as far'],
  ['Alt ↑ ↓', 'Reorder what is chosen'],
  ['Ctrl D', 'Copy what is chosen'],
  ['Esc', 'Break a drag off, choose nothing'],
];

const ARROWS: Record<string, readonly [north: number, east: number]> = {
  ArrowUp: [1, 0],
  ArrowDown: [-1, 0],
  ArrowRight: [0, 1],
  ArrowLeft: [0, -1],
};

type Press = Pick<KeyboardEvent, 'key' | 'ctrlKey' | 'metaKey' | 'altKey' | 'shiftKey'>;

/** Act on a key; returns whether it meant something. */
export function press(editor: DesignEditor, event: Press, kind: 'tank' | 'open'): boolean {
  const isControl = event.ctrlKey || event.metaKey;
  const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
  if (isControl) return pressControl(editor, key, event.shiftKey, kind);
  const arrow = ARROWS[event.key];
  if (event.altKey) {
    if (arrow?.[0] === undefined || arrow[0] === 0 || editor.chosen.size === 0) return false;
    editor.reorderBy(arrow[0] > 0 ? -1 : 1);
    return true;
  }
  if (arrow && editor.chosen.size > 0) {
    const step = NUDGE_M[kind] * (event.shiftKey ? 10 : 1);
    editor.nudge(step * arrow[0], step * arrow[1]);
    return true;
  }
  if ((key === 'Delete' || key === 'Backspace') && editor.chosen.size > 0) {
    editor.remove();
    return true;
  }
  if (key === 'Escape') {
    editor.choose([]);
    editor.mode = 'move';
    return true;
  }
  return false;
}

function pressControl(
  editor: DesignEditor,
  key: string,
  isShifted: boolean,
  kind: 'tank' | 'open',
): boolean {
  if (key === 'z' && !isShifted) editor.undo();
  else if (key === 'y' || key === 'z') editor.redo();
  else if (key === 'a') editor.chooseAll();
  else if (key === 'd') editor.copy(-10 * NUDGE_M[kind], 10 * NUDGE_M[kind]);
  else return false;
  return true;
}
