import { PATTERNS, REPEATS_MS, type SoundKind } from './sound_pattern';

const KEY = 'grace.sound';
/** A tone begins and ends within this, so that it does not click, s. */
const EDGE_S = 0.015;

/**
 * Sounds of this page. A browser lets a page sound only after somebody has touched it: until then,
 * `isBlocked` tells that nothing is heard.
 *
 * `play` sounds once; `repeat` sounds on until it is told `null`.
 */
export class Sound {
  /** Whether this browser's user wants sounds. */
  isOn = $state(true);
  /** From 0 to 1. */
  volume = $state(0.6);
  /** Time of this computer until which nothing sounds, ms since 1970. */
  mutedUntil = $state(0);
  /** Whether the browser lets nothing sound yet. */
  isBlocked = $state(true);
  /** What sounds again and again now. */
  repeated = $state.raw<SoundKind | null>(null);
  #context: AudioContext | null = null;
  #timer: ReturnType<typeof setInterval> | undefined;

  constructor() {
    const kept = read();
    if (typeof kept.isOn === 'boolean') this.isOn = kept.isOn;
    if (typeof kept.volume === 'number') this.volume = Math.min(1, Math.max(0, kept.volume));
  }

  /** Whether something that should be heard would be. */
  get isAudible(): boolean {
    return this.isOn && !this.isBlocked && !this.isMuted;
  }

  get isMuted(): boolean {
    return Date.now() < this.mutedUntil;
  }

  /** To be called by the handler of a click or key: lets the page sound from now on. */
  unblock = async (): Promise<void> => {
    if (typeof AudioContext === 'undefined') return;
    this.#context ??= new AudioContext();
    this.#context.onstatechange = () => (this.isBlocked = this.#context?.state !== 'running');
    await this.#context.resume();
    this.isBlocked = this.#context.state !== 'running';
  };

  /**
   * To be called inside an effect: the first touch of the page, wherever, lets it sound. That is
   * the end of a click, not its begin: what the page says about silence goes then, and a button
   * that moves under a pressed pointer is not clicked.
   */
  listen(): () => void {
    const touched = (): void => {
      if (this.isBlocked) void this.unblock();
    };
    window.addEventListener('click', touched, { capture: true });
    window.addEventListener('keydown', touched);
    return () => {
      window.removeEventListener('click', touched, { capture: true });
      window.removeEventListener('keydown', touched);
    };
  }

  mute(minutes: number): void {
    this.mutedUntil = minutes === 0 ? 0 : Date.now() + minutes * 60_000;
  }

  /** Sound once; tells whether anything is heard. */
  play(kind: SoundKind): boolean {
    const context = this.#context;
    if (!this.isAudible || context === null) return false;
    for (const { at, pitch, length } of PATTERNS[kind]) {
      const begin = context.currentTime + at;
      const tone = new OscillatorNode(context, { type: 'triangle', frequency: pitch });
      const gain = new GainNode(context, { gain: 0 });
      gain.gain.setValueAtTime(0, begin);
      gain.gain.linearRampToValueAtTime(this.volume, begin + EDGE_S);
      gain.gain.setValueAtTime(this.volume, begin + length - EDGE_S);
      gain.gain.linearRampToValueAtTime(0, begin + length);
      tone.connect(gain).connect(context.destination);
      tone.start(begin);
      tone.stop(begin + length);
    }
    return true;
  }

  /** Sound again and again in the rhythm of a kind; `null` ends it. */
  repeat(kind: SoundKind | null): void {
    if (kind === this.repeated) return;
    clearInterval(this.#timer);
    const every = kind === null ? undefined : REPEATS_MS[kind];
    this.repeated = every === undefined ? null : kind;
    if (kind !== null && every !== undefined) {
      this.#timer = setInterval(() => this.play(kind), every);
    }
  }

  /** To be called inside an effect: keeps every change in this browser. */
  keep(): void {
    const kept = JSON.stringify({ isOn: this.isOn, volume: this.volume });
    try {
      localStorage.setItem(KEY, kept);
    } catch {
      // A browser that stores nothing still sounds; it forgets.
    }
  }
}

function read(): Record<string, unknown> {
  try {
    const kept: unknown = JSON.parse(localStorage.getItem(KEY) ?? '{}');
    return typeof kept === 'object' && kept !== null ? (kept as Record<string, unknown>) : {};
  } catch {
    return {};
  }
}
