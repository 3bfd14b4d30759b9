import type { LiveBatch } from '../api/types';

export interface LiveSocketEvents {
  onTick(tick: LiveBatch): void;
  onOpen(): void;
  /** The connection is gone; it is being tried again unless `isRefused`. */
  onClose(isRefused: boolean): void;
}

const POLICY_VIOLATION = 1008;
const FIRST_WAIT_MS = 500;
const LONGEST_WAIT_MS = 8000;
const SILENCE_MS = 10_000;

/** The live stream: connects again by itself and resumes events after the last cursor seen. */
export class LiveSocket {
  #socket: WebSocket | null = null;
  #timer: ReturnType<typeof setTimeout> | undefined;
  #silence: ReturnType<typeof setTimeout> | undefined;
  #wait = FIRST_WAIT_MS;
  #cursor: string | null = null;
  #isOpen = false;
  readonly #events: LiveSocketEvents;

  constructor(events: LiveSocketEvents) {
    this.#events = events;
  }

  open(): void {
    this.#isOpen = true;
    this.#connect();
  }

  close(): void {
    this.#isOpen = false;
    clearTimeout(this.#timer);
    clearTimeout(this.#silence);
    this.#socket?.close();
    this.#socket = null;
  }

  #connect(): void {
    const scheme = location.protocol === 'https:' ? 'wss' : 'ws';
    const after = this.#cursor === null ? '' : `?after=${encodeURIComponent(this.#cursor)}`;
    const socket = new WebSocket(`${scheme}://${location.host}/api/live${after}`);
    this.#socket = socket;
    socket.onopen = () => {
      this.#wait = FIRST_WAIT_MS;
      this.#watchSilence(socket);
      this.#events.onOpen();
    };
    socket.onmessage = (message: MessageEvent<string>) => {
      const tick = JSON.parse(message.data) as LiveBatch;
      this.#cursor = String(tick.cursor);
      this.#watchSilence(socket);
      this.#events.onTick(tick);
    };
    socket.onclose = (event) => {
      if (this.#socket !== socket) return;
      clearTimeout(this.#silence);
      this.#socket = null;
      const isRefused =
        event.code === POLICY_VIOLATION || (event.code >= 4400 && event.code < 4500);
      this.#events.onClose(isRefused);
      if (this.#isOpen) this.#tryLater();
    };
  }

  /** A half-open connection never says so; silence does, because quiet ticks come every second. */
  #watchSilence(socket: WebSocket): void {
    clearTimeout(this.#silence);
    this.#silence = setTimeout(() => {
      if (this.#socket !== socket) return;
      this.#socket = null;
      socket.close();
      this.#events.onClose(false);
      if (this.#isOpen) this.#tryLater();
    }, SILENCE_MS);
  }

  #tryLater(): void {
    clearTimeout(this.#timer);
    this.#timer = setTimeout(() => this.#connect(), this.#wait);
    this.#wait = Math.min(this.#wait * 2, LONGEST_WAIT_MS);
  }
}
