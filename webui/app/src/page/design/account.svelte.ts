import { Problem, sentence } from '../../api/problem';
import type { OutlineView } from '../../api/generated/station';
import type { Design } from './document';
import { estimate, scaledTo, type Account, type Checked, type Rates } from './estimate';

/** What the station makes of a design; its waypoints and legs count from 0. */
export type Outline = OutlineView;
export type OutlineLeg = OutlineView['legs'][number];
export type Fault = OutlineView['violations'][number];

/** Between two questions, ms. */
const REST_MS = 60;
const RETRY_MS = 2000;

/** The account of a design while it changes: an estimate of the page until the station answers. */
export class LiveAccount {
  /** The station's last answer. */
  outline = $state.raw<Outline | null>(null);
  /** Why the station does not answer, or cannot make anything of it. */
  refusal = $state.raw('');
  errors = $state.raw<Problem['errors']>([]);
  rates = $state.raw<Rates | null>(null);
  /** The document that the answer is about. */
  #of = $state.raw<Design | null>(null);
  #wanted: Design | null = null;
  #isAsking = false;
  #isOver = false;
  readonly #ask: (document: Design) => Promise<Outline>;
  readonly #design: () => Design;

  constructor(ask: (document: Design) => Promise<Outline>, design: () => Design) {
    this.#ask = ask;
    this.#design = design;
  }

  /** Whether the station's answer is about what is on the screen. */
  readonly isChecked = $derived.by(() => this.outline !== null && this.#of === this.#design());

  readonly #checked = $derived.by((): Checked | null => {
    if (!this.outline || !this.#of) return null;
    const model = this.rates ? estimate(this.rates, this.#of) : null;
    return { account: this.outline.account, model, wayThere: this.outline.way_there };
  });

  /** The account to be shown; `null` where nothing is known of it. */
  readonly account = $derived.by((): Account | null => {
    if (this.isChecked) return this.outline?.account ?? null;
    const now = this.rates ? estimate(this.rates, this.#design()) : null;
    return now ? scaledTo(now, this.#checked) : (this.outline?.account ?? null);
  });

  /** Ask the station about a document; of several only the newest is asked for. */
  ask(document: Design): void {
    this.#wanted = document;
    if (!this.#isAsking) void this.#run();
  }

  stop(): void {
    this.#isOver = true;
  }

  async #run(): Promise<void> {
    this.#isAsking = true;
    while (this.#wanted && !this.#isOver) {
      const document = this.#wanted;
      this.#wanted = null;
      await this.#answer(document);
    }
    this.#isAsking = false;
  }

  async #answer(document: Design): Promise<void> {
    let restMs = REST_MS;
    try {
      this.outline = await this.#ask(document);
      this.#of = document;
      this.refusal = '';
      this.errors = [];
    } catch (error) {
      this.refusal = sentence(error);
      this.errors = error instanceof Problem ? error.errors : [];
      if (error instanceof Problem && error.status === 0) {
        this.#wanted ??= document;
        restMs = RETRY_MS;
      }
    }
    await new Promise((go) => setTimeout(go, restMs));
  }
}
