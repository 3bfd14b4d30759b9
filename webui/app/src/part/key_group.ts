import { DESIGN_KEYS } from '../page/design/keys';
import { DRIVE_KEYS } from '../page/drive/stick';
import { PAGES } from '../page/route';
import { REPLAY_KEYS } from '../live/replay.svelte';
import { APP_KEYS } from './keyboard';

export interface KeyGroup {
  title: string;
  keys: readonly (readonly [key: string, meaning: string])[];
}

/** Keys that have no table of their own where they are obeyed. */
const ELSEWHERE: readonly KeyGroup[] = [
  {
    title: 'While an area is drawn',
    keys: [
      ['Enter', 'Close the area'],
      ['Backspace', 'Take the last corner back'],
      ['Esc', 'Cancel'],
    ],
  },
  { title: 'In a slice of a map', keys: [['← ↑ ↓ →', 'The place whose value is read']] },
  {
    title: 'In the tour',
    keys: [
      ['← →', 'Step before, step after'],
      ['Esc', 'End it'],
    ],
  },
];

/** Every key of the app, as the sheet of keys lists them. */
export const KEY_GROUPS: readonly KeyGroup[] = [
  {
    title: 'Everywhere',
    keys: [
      ...PAGES.map(({ letter, title }) => [`g ${letter}`, title] as const),
      ...Object.entries(APP_KEYS).map(([key, { meaning }]) => [key, meaning] as const),
      ['Enter', 'Held for a second: what a button says that is held'],
      ['Esc', 'Close what is open'],
    ],
  },
  { title: 'On the page of designs', keys: DESIGN_KEYS },
  { title: 'In a replay', keys: REPLAY_KEYS.map(({ name, meaning }) => [name, meaning] as const) },
  { title: 'While you drive a robot', keys: DRIVE_KEYS },
  ...ELSEWHERE,
];
