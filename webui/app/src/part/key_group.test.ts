import { expect, test, vi } from 'vitest';
import type { DesignEditor } from '../page/design/editor.svelte';
import { DESIGN_KEYS, press } from '../page/design/keys';
import { DRIVE_KEYS, STOP_KEYS, steeringKey } from '../page/drive/stick';
import { PAGES } from '../page/route';
import { Keyboard } from './keyboard';
import { KEY_GROUPS } from './key_group';

/** How the sheet writes keys that have a longer name, and how the browser names them. */
const NAMES: Record<string, string> = {
  '←': 'ArrowLeft',
  '→': 'ArrowRight',
  '↑': 'ArrowUp',
  '↓': 'ArrowDown',
  Del: 'Delete',
  Esc: 'Escape',
  Space: ' ',
};

/** Keys of a line of the sheet that are pressed one by one, without what is held beside them. */
function pressed(line: string): string[] {
  return line
    .split(' ')
    .filter((key) => key !== 'Ctrl' && key !== 'Alt')
    .map((key) => NAMES[key] ?? key);
}

/** All printable keys and the named ones. */
const ALL = [
  ...Array.from({ length: 94 }, (_, i) => String.fromCharCode(33 + i)),
  ...Object.values(NAMES),
  'Backspace',
  'PageUp',
  'PageDown',
  'Home',
  'End',
  'Tab',
];

test('what the app obeys everywhere is what the sheet lists for everywhere', () => {
  const actions = { go: vi.fn(), choose: vi.fn(), help: vi.fn(), replay: vi.fn(() => false) };
  const listed = KEY_GROUPS[0]?.keys.map(([key]) => key) ?? [];
  const obeyed = ALL.filter((key) => new Keyboard(actions).press(key));
  const single = listed.filter((key) => !key.startsWith('g ') && key.length === 1);
  expect(new Set(obeyed)).toEqual(new Set([...single, 'g']));
  const afterG = ALL.filter((key) => {
    const keyboard = new Keyboard(actions);
    keyboard.press('g');
    return keyboard.press(key);
  });
  expect(afterG.sort()).toEqual(PAGES.map(({ letter }) => letter as string).sort());
  for (const letter of afterG) expect(listed).toContain(`g ${letter}`);
});

test('no two pages have one letter', () => {
  expect(new Set(PAGES.map(({ letter }) => letter)).size).toBe(PAGES.length);
});

function editor(): DesignEditor {
  const known: Record<string, unknown> = { chosen: new Set(['a']), mode: 'move' };
  return new Proxy(known, { get: (of, key) => of[key as string] ?? vi.fn() }) as never;
}

test('every key of designs that the sheet lists is obeyed, and none beside them', () => {
  const obeyed = (key: string, held: { ctrlKey?: boolean; altKey?: boolean }) =>
    press(
      editor(),
      { key, ctrlKey: false, altKey: false, metaKey: false, shiftKey: false, ...held },
      'tank',
    );
  for (const [mode, held] of [
    ['', {}],
    ['Ctrl', { ctrlKey: true }],
    ['Alt', { altKey: true }],
  ] as const) {
    const lines = DESIGN_KEYS.filter(([line]) =>
      mode ? line.startsWith(mode) : !/^(Ctrl|Alt)/.test(line),
    );
    const listed = lines.flatMap(([line]) => pressed(line));
    const found = ALL.filter((key) => obeyed(key, held));
    const asWritten = new Set(found.map((key) => (mode === 'Ctrl' ? key.toUpperCase() : key)));
    asWritten.delete('Backspace'); // the same as Del, on keyboards that have none
    expect(asWritten).toEqual(new Set(listed));
  }
});

test('every key that steers or stops a robot is on the sheet, and none beside them', () => {
  const listed = new Set(DRIVE_KEYS.flatMap(([line]) => pressed(line)));
  const steering = ALL.filter((key) => steeringKey(key) !== null || STOP_KEYS.includes(key));
  const asWritten = new Set(steering.map((key) => (key.length === 1 ? key.toUpperCase() : key)));
  expect(asWritten).toEqual(listed);
});
