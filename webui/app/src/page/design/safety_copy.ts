import { same, type Design, type DesignView } from './document';

/** What a browser keeps of a change until the station has it. */
export interface SafetyCopy {
  /** Page that it was made in. */
  page: string;
  /** Revision that the change went out from. */
  revision: number;
  document: Design;
  what: string;
  /** Local time, ms since 1970. */
  at: number;
}

const PREFIX = 'grace.design.';
const CHANNEL = 'grace.design';
/** Pages of one browser answer each other within this. */
const ANSWER_MS = 250;

interface Word {
  kind: 'who' | 'me';
  page: string;
}

/** Which pages of this browser are open on designs; answers the others until it is stopped. */
export class LivingPages {
  readonly #channel = new BroadcastChannel(CHANNEL);
  readonly #page: string;
  readonly #others = new Set<string>();

  constructor(page: string) {
    this.#page = page;
    this.#channel.onmessage = ({ data }: MessageEvent<Word>) => {
      if (data.kind === 'who') this.#say('me');
      else this.#others.add(data.page);
    };
  }

  /** The other pages that are open now. */
  async others(): Promise<ReadonlySet<string>> {
    this.#others.clear();
    this.#say('who');
    await new Promise((go) => setTimeout(go, ANSWER_MS));
    return this.#others;
  }

  stop(): void {
    this.#channel.close();
  }

  #say(kind: Word['kind']): void {
    this.#channel.postMessage({ kind, page: this.#page } satisfies Word);
  }
}

/** Copies of what was changed and is not known to be kept, one a design and page. */
export class SafetyCopies {
  readonly #storage: Pick<Storage, 'getItem' | 'setItem' | 'removeItem' | 'key' | 'length'>;
  readonly #page: string;

  constructor(storage: Storage, page: string) {
    this.#storage = storage;
    this.#page = page;
  }

  keep(
    { id, revision }: Pick<DesignView, 'id' | 'revision'>,
    document: Design,
    what: string,
  ): void {
    const copy: SafetyCopy = { page: this.#page, revision, document, what, at: Date.now() };
    try {
      this.#storage.setItem(`${PREFIX}${id}.${this.#page}`, JSON.stringify(copy));
    } catch {
      // A full or forbidden storage takes nothing away from what the station keeps.
    }
  }

  forget(id: string): void {
    this.#storage.removeItem(`${PREFIX}${id}.${this.#page}`);
  }

  /** Copies of pages that are no longer open, where they say something else than the station. */
  left(
    { id, document }: Pick<DesignView, 'id' | 'document'>,
    living: ReadonlySet<string>,
  ): SafetyCopy[] {
    const found: SafetyCopy[] = [];
    for (const key of this.#keys(id)) {
      const copy = read(this.#storage.getItem(key));
      if (copy === null) this.#storage.removeItem(key);
      else if (living.has(copy.page)) continue;
      else if (same(copy.document, document)) this.#storage.removeItem(key);
      else if (copy.page !== this.#page) found.push(copy);
    }
    return found.toSorted((a, b) => b.at - a.at);
  }

  drop(id: string, { page }: SafetyCopy): void {
    this.#storage.removeItem(`${PREFIX}${id}.${page}`);
  }

  #keys(id: string): string[] {
    const all = Array.from({ length: this.#storage.length }, (_, i) => this.#storage.key(i) ?? '');
    return all.filter((key) => key.startsWith(`${PREFIX}${id}.`));
  }
}

function read(text: string | null): SafetyCopy | null {
  try {
    const value = JSON.parse(text ?? 'null') as SafetyCopy | null;
    return value && typeof value.page === 'string' && typeof value.document === 'object'
      ? value
      : null;
  } catch {
    return null;
  }
}
