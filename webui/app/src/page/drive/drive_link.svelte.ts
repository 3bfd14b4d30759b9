import type { Drive } from '../../api/types';
import { RoundTrips, type Latency } from './round_trips';
import { CENTRE, isCentre, type Stick } from './stick';

/** Between two sticks while one is held; the robot stops after 500 ms without any. */
const HELD_MS = 66;
/** Between two sticks in the middle: they only say that the pilot is there. */
const RESTING_MS = 200;

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

  readonly #robot: string;
  readonly #stick: () => Stick;
  readonly #trips = new RoundTrips();
  #socket: WebSocket | null = null;
  #timer: ReturnType<typeof setInterval> | undefined;
  #n = 0;
  #sentAt = 0;

  /** `stick` tells where the stick is at each moment. */
  constructor(robot: string, stick: () => Stick) {
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

  /** Say where the stick is, if that is due; a change is said at once. */
  tick(): void {
    if (this.state !== 'driving' || this.isAway) return;
    const stick = this.#stick();
    const now = performance.now();
    const isChanged = !isSame(stick, this.sent);
    const due = isCentre(stick) ? RESTING_MS : HELD_MS;
    if (isChanged ? now - this.#sentAt >= HELD_MS / 2 : now - this.#sentAt >= due)
      this.#send(stick);
  }

  #send(stick: Stick): void {
    const socket = this.#socket;
    // A line that is stuck takes no more: what waited there would come too late.
    if (socket?.readyState !== WebSocket.OPEN || socket.bufferedAmount > 0) return;
    this.#n += 1;
    this.#sentAt = performance.now();
    this.#trips.sent(this.#n, this.#sentAt);
    this.sent = stick;
    socket.send(JSON.stringify({ n: this.#n, ...stick }));
  }

  #take(told: Drive): void {
    const now = performance.now();
    this.told = told;
    this.toldAt = now;
    if (told.newest) this.#trips.answered(told.newest.n, now);
    this.latency = this.#trips.ofLate(now);
    if (told.state === 'driving' && this.state === 'beginning') {
      this.state = 'driving';
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
