import {
  CENTRE,
  STOP_KEYS,
  isAlike,
  isCentre,
  limited,
  ofGamepad,
  ofKeys,
  steeringKey,
  type Stick,
} from './stick';

const STOP_BUTTON = 1;

/** Everything that a pilot can hold: keys, a finger on the screen, a gamepad. */
export class Controls {
  /** Keys that are held. */
  held = $state.raw<readonly string[]>([]);
  /** What fingers hold on the screen. */
  finger = $state.raw<Stick>(CENTRE);
  /** Whether a finger holds the button that keeps the robot at its depth. */
  isStaying = $state.raw(false);
  /** Name of the gamepad, once one of its buttons was pressed; "" without one. */
  gamepad = $state.raw('');
  /** How far a full stick goes, 0 to 1. */
  reach = $state(0.6);

  readonly #onStop: () => void;
  #pad = $state.raw<Stick>(CENTRE);

  constructor(onStop: () => void) {
    this.#onStop = onStop;
  }

  /** Where the stick is now: what is held on the screen goes before keys, keys before a gamepad. */
  stick(): Stick {
    const [found = CENTRE] = [this.finger, ofKeys(this.held), this.#pad].filter(
      (one) => !isCentre(one),
    );
    return limited(found, this.reach);
  }

  /** Whether anything is held: keys that cancel each other are, a gamepad at rest is not. */
  get isHeld(): boolean {
    const isSteered = [this.finger, this.#pad].some((one) => !isCentre(one));
    return isSteered || this.isStaying || this.held.length > 0;
  }

  /** Let go of everything. */
  release(): void {
    this.held = [];
    this.finger = CENTRE;
    this.isStaying = false;
    this.#pad = CENTRE;
  }

  /** Listen while somebody drives; returns the end of it. */
  listen(): () => void {
    const onkeydown = (event: KeyboardEvent) => {
      if (event.ctrlKey || event.metaKey || event.altKey || isTyping(event.target)) return;
      if (STOP_KEYS.includes(event.key)) this.#onStop();
      else if (!this.#hold(event.key)) return;
      event.preventDefault();
      event.stopPropagation();
    };
    const onkeyup = (event: KeyboardEvent) => {
      const key = steeringKey(event.key);
      if (key) this.held = this.held.filter((one) => one !== key);
    };
    // Before the keys of the whole app, which mean something else.
    addEventListener('keydown', onkeydown, { capture: true });
    addEventListener('keyup', onkeyup, { capture: true });
    const look = () => {
      this.#look();
      frame = requestAnimationFrame(look);
    };
    // Not at once: whoever listens in an effect does not depend on where the gamepad is.
    let frame = requestAnimationFrame(look);
    return () => {
      cancelAnimationFrame(frame);
      removeEventListener('keydown', onkeydown, { capture: true });
      removeEventListener('keyup', onkeyup, { capture: true });
      this.release();
    };
  }

  #hold(pressed: string): boolean {
    const key = steeringKey(pressed);
    if (key && !this.held.includes(key)) this.held = [...this.held, key];
    return key !== null;
  }

  #look(): void {
    const pad = navigator.getGamepads().find((one) => one?.connected);
    this.gamepad = pad?.id ?? '';
    const stick = pad ? ofGamepad(pad.axes) : CENTRE;
    if (!isAlike(stick, this.#pad)) this.#pad = stick;
    if (pad?.buttons.some(({ pressed }, number) => pressed && number === STOP_BUTTON)) {
      this.#onStop();
    }
  }
}

function isTyping(target: EventTarget | null): boolean {
  return target instanceof Element && target.matches('input:not([type=radio]), select, textarea');
}
