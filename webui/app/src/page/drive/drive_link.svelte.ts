import type { Drive } from '../../api/types';
import { RoundTrips, type Latency } from './round_trips';
import { CENTRE, type Stick } from './stick';

/** Between two sticks while one is held; the robot stops after 500 ms without any. */
const HELD_MS = 66;
/** How often a stick that was let go is said to be in the middle: a word may be lost by radio. */
const CENTRES = 4;

export type DriveState = 'off' | 'beginning' | 'driving' | 'ended';

/** One pilot's line to one robot: opening it begins to drive, closing it ends that. */
export class DriveLink {
  state = $state.raw<DriveState>('off');
  /** Why it ended or was refused, one sentence of the station. */
  reason = $state.raw('');
  /** The station's newest word. */
  told = $state.raw<Drive | null>(null);
  /** Local `performance.now()` of that word. */
  toldAt = $state.raw(0);
  latency = $state.raw<Latency | null>(null);
  /** What was sent last. */
  sent = $state.raw<Stick>(CENTRE);
  /** Nothing is sent while the pilot looks elsewhere: the robot stops by itself. */
  isAway = $state.raw(false);
  /** Local `performance.now()` since which nothing is sent as nothing is held; `null` if it is. */
  silentAt = $state.raw<number | null>(null);

  readonly #robot: string;
  readonly #stick: () => Stick | null;
  readonly #trips = new RoundTrips();
  #socket: WebSocket | null = null;
  #timer: ReturnType<typeof setInterval> | undefined;
  #n = 0;
  #sentAt = 0;
  /** Times that the stick is still to be said to be in the middle. */
  #centres = 0;

  /** `stick` tells where the stick is at each moment; `null` while nobody holds it. */
  constructor(robot: string, stick: () => Stick | null) {
    this.#robot = robot;
    this.#stick = stick;
  }

  begin(): void {
    if (this.#socket) return;
    const scheme = location.protocol === 'https:' ? 'wss' : 'ws';
    const path = `/api/robots/${encodeURIComponent(this.#robot)}/drive`;
    const socket = new WebSocket(`${scheme}://${location.host}${path}`);
    this.#socket = socket;
    this.state = 'beginning';
    this.reason = '';
    this.told = null;
    this.latency = null;
    this.silentAt = null;
    this.isAway = document.hidden || !document.hasFocus();
    socket.onmessage = (message: MessageEvent<string>) =>
      this.#take(JSON.parse(message.data) as Drive);
    socket.onclose = () => this.#closed(socket);
  }

  /** End it: the stick in the middle, then the word, then the line. */
  stop(): void {
    if (!this.#socket) return;
    this.#send(CENTRE);
    if (this.#socket.readyState === WebSocket.OPEN) this.#socket.send('stop');
    else this.#socket.close();
    clearInterval(this.#timer);
  }

  /** The page goes: nobody waits for a last word. */
  leave(): void {
    this.stop();
    this.#socket?.close();
  }

  /** The pilot looks elsewhere, or here again. */
  setAway(isAway: boolean): void {
    if (isAway && !this.isAway && this.state === 'driving') this.#send(CENTRE);
    this.isAway = isAway;
  }

  /**
   * Say where the stick is, if that is due; a change is said at once.
   *
   * A stick that is let go is said to be in the middle, at once and a few times; then nothing is
   * said, as a robot that hears nothing is one that nobody holds.
   */
  tick(): void {
    if (this.state !== 'driving' || this.isAway) return;
    const held = this.#stick();
    const sinceMs = performance.now() - this.#sentAt;
    if (held === null) this.#letGo(sinceMs);
    else {
      this.#centres = CENTRES;
      this.silentAt = null;
      const due = isSame(held, this.sent) ? HELD_MS : HELD_MS / 2;
      if (sinceMs >= due) this.#send(held);
    }
  }

  #letGo(sinceMs: number): void {
    const isFirst = this.#centres === CENTRES;
    if (this.#centres > 0 && (isFirst || sinceMs >= HELD_MS) && this.#send(CENTRE)) {
      this.#centres -= 1;
    }
    if (this.#centres === 0) this.silentAt ??= performance.now();
  }

  /** Send a stick; tells whether the line took it. */
  #send(stick: Stick): boolean {
    const socket = this.#socket;
    // A line that is stuck takes no more: what waited there would come too late.
    if (socket?.readyState !== WebSocket.OPEN || socket.bufferedAmount > 0) return false;
    this.#n += 1;
    this.#sentAt = performance.now();
    this.#trips.sent(this.#n, this.#sentAt);
    this.sent = stick;
    socket.send(JSON.stringify({ n: this.#n, ...stick }));
    return true;
  }

  #take(told: Drive): void {
    const now = performance.now();
    this.told = told;
    this.toldAt = now;
    if (told.newest) this.#trips.answered(told.newest.n, now);
    this.latency = this.#trips.ofLate(now);
    if (told.state === 'driving' && this.state === 'beginning') {
      this.state = 'driving';
      this.#centres = 1;
      this.#timer = setInterval(() => this.tick(), HELD_MS / 4);
    }
    if (told.state === 'ended') this.#end(told.reason);
  }

  #closed(socket: WebSocket): void {
    if (this.#socket !== socket) return;
    this.#socket = null;
    const isBegun = this.state === 'driving';
    this.#end(
      isBegun
        ? 'The line to the station broke. The robot stops by itself.'
        : 'The station does not let you drive: sign in again as a pilot.',
    );
  }

  #end(reason: string): void {
    clearInterval(this.#timer);
    if (this.state !== 'ended') this.reason = reason;
    this.state = 'ended';
    this.sent = CENTRE;
  }
}

function isSame(one: Stick, other: Stick): boolean {
  return one.forward === other.forward && one.turn === other.turn && one.up === other.up;
}
