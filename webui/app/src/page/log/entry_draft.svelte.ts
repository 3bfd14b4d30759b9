import type { LogPicture } from '../../api/types';

const KEY = 'grace.log.draft.';

interface Kept {
  text: string;
  robot: string;
  at: string;
  tags: string;
  pictures: readonly LogPicture[];
}

const EMPTY: Kept = { text: '', robot: '', at: '', tags: '', pictures: [] };

/** What somebody is writing: kept in the browser with every letter, until it is sent. */
export class EntryDraft {
  readonly #key: string;
  readonly #first: Kept;
  #kept = $state.raw<Kept>(EMPTY);

  /**
   * @param name What it is written for: a new entry, a change of one, a correction.
   * @param first What it says before anybody writes.
   */
  constructor(name: string, first: Partial<Kept> = {}) {
    this.#key = KEY + name;
    this.#first = { ...EMPTY, ...first };
    this.#kept = read(this.#key) ?? this.#first;
  }

  readonly kept = $derived.by(() => this.#kept);
  readonly isEmpty = $derived.by(() => this.#kept.text.trim() === '');
  readonly tags = $derived.by(() =>
    this.#kept.tags
      .split(',')
      .map((tag) => tag.trim())
      .filter(Boolean),
  );

  set(change: Partial<Kept>): void {
    this.#kept = { ...this.#kept, ...change };
    try {
      localStorage.setItem(this.#key, JSON.stringify(this.#kept));
    } catch {
      // A browser that stores nothing still sends what is on the screen.
    }
  }

  clear(): void {
    this.#kept = this.#first;
    try {
      localStorage.removeItem(this.#key);
    } catch {
      // It was not kept.
    }
  }
}

function read(key: string): Kept | null {
  try {
    const kept: unknown = JSON.parse(localStorage.getItem(key) ?? 'null');
    if (typeof kept !== 'object' || kept === null) return null;
    const { text, robot, at, tags, pictures } = { ...EMPTY, ...(kept as Partial<Kept>) };
    const isWhole = [text, robot, at, tags].every((one) => typeof one === 'string');
    return isWhole && Array.isArray(pictures) ? { text, robot, at, tags, pictures } : null;
  } catch {
    return null;
  }
}
