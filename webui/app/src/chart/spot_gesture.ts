/** What a pointer does with the places of a design on a map: take hold, drag, let go. */

/** A place on the screen, px. */
export interface Pixel {
  x: number;
  y: number;
}

/** What can be taken hold of. */
export type Grip =
  | { kind: 'spot'; index: number }
  /** The middle of the leg behind a place: a new place comes there. */
  | { kind: 'leg'; index: number }
  /** Handles of the box around what is chosen, and of a circle. */
  | { kind: 'turn' }
  | { kind: 'scale' }
  | { kind: 'radius' };

export interface Gripped {
  grip: Grip;
  at: Pixel;
}

const MOUSE_PX = 11;
const FINGER_PX = 24;
/** Less is a click. */
const DRAG_PX = 4;

/** The nearest thing in reach of a pointer; of two equally near ones the later in the list. */
export function gripAt(grips: readonly Gripped[], at: Pixel, reachPx: number): Grip | null {
  let found: Grip | null = null;
  let least = reachPx;
  for (const { grip, at: place } of grips) {
    const away = Math.hypot(place.x - at.x, place.y - at.y);
    if (away > least) continue;
    least = away;
    found = grip;
  }
  return found;
}

export interface GestureHandlers {
  /** What there is to take hold of now. */
  grips: () => readonly Gripped[];
  /** Whether a drag over free water chooses what lies in it, instead of moving the map. */
  bands: () => boolean;
  onpick: (grip: Grip, isMore: boolean, at: Pixel) => void;
  onbegin: (grip: Grip, at: Pixel) => void;
  ondrag: (at: Pixel) => void;
  /** `isKept` is false where it was broken off. */
  onend: (isKept: boolean) => void;
  onband: (from: Pixel, to: Pixel, isOver: boolean, isMore: boolean) => void;
}

type Action = { kind: 'press' | 'drag'; grip: Grip } | { kind: 'band' };

/** Listens on the element of a map before the map does, and takes what is meant for the design. */
export class SpotGesture {
  readonly #element: HTMLElement;
  readonly #handlers: GestureHandlers;
  #action: Action | null = null;
  #pointer: number | null = null;
  #from: Pixel = { x: 0, y: 0 };
  #isMore = false;
  readonly #listening = new AbortController();

  constructor(element: HTMLElement, handlers: GestureHandlers) {
    this.#element = element;
    this.#handlers = handlers;
    const { signal } = this.#listening;
    const early = { capture: true, signal };
    element.addEventListener('pointerdown', (event) => this.#down(event), early);
    element.addEventListener('pointermove', (event) => this.#move(event), early);
    element.addEventListener('pointerup', (event) => this.#up(event), early);
    element.addEventListener('pointercancel', () => this.#leave(false), early);
    // What Leaflet hears beside the pointer would move the map along.
    for (const kind of ['mousedown', 'touchstart']) {
      element.addEventListener(kind, (event) => this.#action && event.stopPropagation(), early);
    }
    addEventListener('keydown', (event) => this.#key(event), early);
  }

  get isDragging(): boolean {
    return this.#action?.kind === 'drag';
  }

  stop(): void {
    this.#leave(false);
    this.#listening.abort();
  }

  #at({ clientX, clientY }: MouseEvent): Pixel {
    const box = this.#element.getBoundingClientRect();
    return { x: clientX - box.left, y: clientY - box.top };
  }

  #down(event: PointerEvent): void {
    if (event.button !== 0 || this.#action) return;
    const at = this.#at(event);
    const reach = event.pointerType === 'mouse' ? MOUSE_PX : FINGER_PX;
    const grip = gripAt(this.#handlers.grips(), at, reach);
    this.#isMore = event.shiftKey || event.ctrlKey || event.metaKey;
    if (grip) this.#action = { kind: 'press', grip };
    else if (this.#handlers.bands() || event.shiftKey) this.#action = { kind: 'band' };
    else return;
    this.#from = at;
    this.#pointer = event.pointerId;
    this.#element.setPointerCapture(event.pointerId);
    this.#element.focus({ preventScroll: true });
    event.stopPropagation();
  }

  #move(event: PointerEvent): void {
    if (!this.#action || event.pointerId !== this.#pointer) return;
    event.stopPropagation();
    const at = this.#at(event);
    if (this.#action.kind === 'band') {
      this.#handlers.onband(this.#from, at, false, this.#isMore);
      return;
    }
    const far = Math.hypot(at.x - this.#from.x, at.y - this.#from.y);
    if (this.#action.kind === 'press') {
      if (far < DRAG_PX) return;
      this.#action = { kind: 'drag', grip: this.#action.grip };
      this.#handlers.onbegin(this.#action.grip, this.#from);
    }
    this.#handlers.ondrag(at);
  }

  #up(event: PointerEvent): void {
    if (!this.#action || event.pointerId !== this.#pointer) return;
    event.stopPropagation();
    const action = this.#action;
    if (action.kind === 'band') {
      this.#handlers.onband(this.#from, this.#at(event), true, this.#isMore);
    } else if (action.kind === 'press')
      this.#handlers.onpick(action.grip, this.#isMore, this.#from);
    this.#leave(true);
    this.#swallow();
  }

  /** The click that follows is not one on the water. */
  #swallow(): void {
    const stop = (event: Event) => event.stopPropagation();
    this.#element.addEventListener('click', stop, { capture: true, once: true });
    setTimeout(() => this.#element.removeEventListener('click', stop, { capture: true }), 0);
  }

  #leave(isKept: boolean): void {
    const action = this.#action;
    this.#action = null;
    if (this.#pointer !== null && this.#element.hasPointerCapture(this.#pointer)) {
      this.#element.releasePointerCapture(this.#pointer);
    }
    this.#pointer = null;
    if (action?.kind === 'drag') this.#handlers.onend(isKept);
    else if (action?.kind === 'band' && !isKept) {
      this.#handlers.onband(this.#from, this.#from, true, true);
    }
  }

  #key(event: KeyboardEvent): void {
    if (event.key !== 'Escape' || !this.#action) return;
    event.stopPropagation();
    this.#leave(false);
  }
}
