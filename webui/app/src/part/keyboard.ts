import { PAGES, type PageKey } from '../page/route';

export interface KeyboardActions {
  go(page: PageKey): void;
  choose(step: 1 | -1): void;
  help(): void;
  /** Obey a key of a replay; tells whether one is on and it was one. */
  replay(key: string, shift: boolean): boolean;
}

/** Single keys; `g` and a letter goes to a page. */
export const APP_KEYS: Readonly<
  Record<string, { meaning: string; act: (actions: KeyboardActions) => void }>
> = {
  '[': { meaning: 'Robot before', act: (actions) => actions.choose(-1) },
  ']': { meaning: 'Robot after', act: (actions) => actions.choose(1) },
  '?': { meaning: 'This sheet', act: (actions) => actions.help() },
};

const SECOND_KEY_MS = 1500;

/** Keys of the whole app. None of them transmits anything. */
export class Keyboard {
  #isGoing = false;
  #timer: ReturnType<typeof setTimeout> | undefined;
  readonly #actions: KeyboardActions;

  constructor(actions: KeyboardActions) {
    this.#actions = actions;
  }

  listen(): () => void {
    const onkeydown = (event: KeyboardEvent) => {
      if (event.ctrlKey || event.metaKey || event.altKey || isTyping(event.target)) return;
      if (!this.#isGoing && !hasOwnKeys(event.target, event.key)) {
        if (this.#actions.replay(event.key, event.shiftKey)) {
          event.preventDefault();
          return;
        }
      }
      if (this.press(event.key)) event.preventDefault();
    };
    addEventListener('keydown', onkeydown);
    return () => {
      clearTimeout(this.#timer);
      removeEventListener('keydown', onkeydown);
    };
  }

  /** Act on a key; returns whether it meant something. */
  press(key: string): boolean {
    if (this.#isGoing) {
      this.#isGoing = false;
      const page = PAGES.find(({ letter }) => letter === key);
      if (page) this.#actions.go(page.key);
      return page !== undefined;
    }
    if (key === 'g') {
      this.#isGoing = true;
      clearTimeout(this.#timer);
      this.#timer = setTimeout(() => (this.#isGoing = false), SECOND_KEY_MS);
      return true;
    }
    APP_KEYS[key]?.act(this.#actions);
    return Object.hasOwn(APP_KEYS, key);
  }
}

function isTyping(target: EventTarget | null): boolean {
  return target instanceof Element && target.matches('input:not([type=radio]), select, textarea');
}

/** Whether a key means something to what has the focus: a button takes space, a choice the arrows. */
function hasOwnKeys(target: EventTarget | null, key: string): boolean {
  if (document.querySelector('dialog[open]')) return true;
  if (!(target instanceof Element)) return false;
  if (key === ' ') return target.closest('button, a, summary, input, [role=button]') !== null;
  return key.length > 1 && target.closest('input, [role=slider], .leaflet-container') !== null;
}
