import type { Api } from '../api/client';
import { Problem, sentence } from '../api/problem';
import { Draft, type Needs } from '../form/draft.svelte';

/** Members of a kind of settings that another part of the page shows. */
export interface Elsewhere {
  members: readonly string[];
  /** Where to look when only these were refused. */
  hint: string;
}

const NOWHERE: Elsewhere = { members: [], hint: '' };

/** Settings of one kind and robot in a form that something is asked of the station with. */
export class KindForm {
  draft = $state.raw<Draft | null>(null);
  isAsking = $state.raw(false);
  #refused = $state.raw<{ text: string; of: unknown } | null>(null);
  readonly #api: Api;
  readonly #elsewhere: Elsewhere;

  constructor(api: Api, elsewhere: Elsewhere = NOWHERE) {
    this.#api = api;
    this.#elsewhere = elsewhere;
  }

  /** Why it was not read or not taken; what was refused is not what stands there once changed. */
  readonly refusal = $derived.by(() =>
    this.#refused !== null && this.#refused.of === this.draft?.value ? this.#refused.text : '',
  );

  /** Read the form; `needs` tells which fields mean nothing with what stands in others. */
  async load(kind: string, robot: string, needs?: Needs): Promise<void> {
    try {
      const [schema, { value: document }] = await Promise.all([
        this.#api.configSchema(kind),
        this.#api.config(kind, robot),
      ]);
      const { members } = this.#elsewhere;
      this.draft = new Draft(schema, document.value, document.preset, needs, members);
    } catch (error) {
      this.#refuse(sentence(error));
    }
  }

  /** Ask with what stands in the form; taken, it holds for the robot from then on. */
  async ask(act: (draft: Draft) => Promise<void>): Promise<void> {
    const { draft } = this;
    if (draft === null || this.isAsking) return;
    this.isAsking = true;
    this.#refused = null;
    draft.forgive();
    try {
      await act(draft);
      draft.keep();
    } catch (error) {
      // What names a field is shown there, and once only.
      if (error instanceof Problem && error.errors.length > 0) {
        draft.refuse(error);
        const { members, hint } = this.#elsewhere;
        if (error.errors.every(({ path }) => members.includes(path[0] ?? ''))) this.#refuse(hint);
      } else this.#refuse(sentence(error));
    } finally {
      this.isAsking = false;
    }
  }

  #refuse(text: string): void {
    this.#refused = { text, of: this.draft?.value };
  }
}
