import type { FieldError, Problem } from '../api/problem';
import type { Json, JsonObject } from '../api/types';
import { fault } from './check';
import { formTree, type FormNode, type GroupNode } from './schema';
import { words } from '../text/word';
import { difference, isSame, leaves, valueAt, withValue } from './value';

/** Whether a field, by its path, means anything beside the form's other values. */
export type Needs = (path: readonly string[], value: JsonObject) => boolean;

/** A form being filled: a model's schema, its stored value, and what the person changed. */
export class Draft {
  readonly tree: GroupNode;
  stored = $state.raw<JsonObject>({});
  value = $state.raw<JsonObject>({});
  /** What the station refused, by path. */
  refused = $state.raw<readonly FieldError[]>([]);
  /** Texts that are typed but are no value, by path. */
  #unreadable = $state.raw<Readonly<Record<string, string>>>({});
  /** Another object whenever the form is filled as a whole: what is half typed is void then. */
  filling = $state.raw({});
  readonly #preset: JsonObject;

  readonly #needs: Needs;
  /** Members that another part of the page shows. */
  readonly #elsewhere: readonly string[];

  /** `needs` tells which fields mean nothing with what stands in others. */
  constructor(
    schema: JsonObject,
    stored: JsonObject,
    preset: JsonObject,
    needs: Needs = () => true,
    elsewhere: readonly string[] = [],
  ) {
    this.tree = formTree(schema);
    this.#preset = preset;
    this.#needs = needs;
    this.#elsewhere = elsewhere;
    this.load(stored);
  }

  load(stored: JsonObject): void {
    this.stored = stored;
    this.replace(stored);
  }

  /** Let the form hold another document; what is stored stays. */
  replace(value: JsonObject): void {
    this.value = value;
    this.refused = [];
    this.#unreadable = {};
    this.filling = {};
  }

  /** Load what of a document this form knows; what the document lacks stays as it is. */
  loadKnown(document: JsonObject): void {
    let next = this.value;
    for (const { path } of leaves(this.tree)) {
      const known = valueAt(document, path);
      if (known !== undefined) next = withValue(next, path, known);
    }
    this.load(next);
  }

  /** Take what is in the form for stored. */
  keep(): void {
    this.stored = this.value;
  }

  readonly isChanged = $derived(!isSame(this.stored, this.value));

  readonly isValid = $derived.by(
    () =>
      Object.keys(this.#unreadable).length === 0 &&
      leaves(this.tree).every((node) => fault(node, this.at(node)) === null),
  );

  /** Errors of the station that belong to no field of the form. */
  readonly strays = $derived.by(() =>
    this.refused
      .filter(({ path }) => nodeAt(this.tree, path) === null || path.length === 0)
      .map(({ path, message }) => ({ path, message: worded(message, this.tree) })),
  );

  /** The changed members alone. */
  get patch(): JsonObject {
    return difference(this.stored, this.value);
  }

  at(node: FormNode): Json | undefined {
    return valueAt(this.value, node.path) ?? (node.isNullable ? null : undefined);
  }

  set(node: FormNode, value: Json): void {
    this.value = withValue(this.value, node.path, value);
    this.#forget(node);
  }

  /** Note that what stands in a field is no value. */
  setUnreadable(node: FormNode, message: string): void {
    this.#forget(node);
    this.#unreadable = { ...this.#unreadable, [node.path.join('.')]: message };
  }

  /** Value that a reset returns to. */
  default(node: FormNode): Json | undefined {
    return valueAt(this.#preset, node.path) ?? node.default;
  }

  /** Fields worth showing whose value is not what a reset returns to. */
  readonly departures = $derived.by(() =>
    leaves(this.tree).filter((node) => this.isInUse(node) && !this.isDefault(node)),
  );

  /** Return every field to its default; what another part of the page shows stays. */
  resetAll(): void {
    let next = this.value;
    for (const node of leaves(this.tree)) {
      const known = this.default(node);
      if (known === undefined || this.#isElsewhere(node)) continue;
      if (!isSame(known, this.at(node))) next = withValue(next, node.path, known);
    }
    this.replace(next);
  }

  isDefault(node: FormNode): boolean {
    const known = this.default(node);
    return known === undefined || isSame(known, this.at(node));
  }

  /** Whether a field is worth showing; what is wrong always is. */
  isInUse(node: FormNode): boolean {
    if (this.#isElsewhere(node)) return false;
    return (
      this.#needs(node.path, this.value) || leaves(node).some((each) => this.error(each) !== null)
    );
  }

  isUnsaved(node: FormNode): boolean {
    return !isSame(valueAt(this.stored, node.path), valueAt(this.value, node.path));
  }

  error(node: FormNode): string | null {
    const typed = this.#unreadable[node.path.join('.')];
    if (typed !== undefined) return typed;
    const said = this.refused.find(({ path }) => leadsTo(this.tree, path, node));
    if (said) return worded(said.message, node);
    return node.kind === 'group' ? null : fault(node, this.at(node));
  }

  /** What was refused is asked for again. */
  forgive(): void {
    this.refused = [];
  }

  /** Show a refusal beside the fields it names. */
  refuse(problem: Problem): void {
    this.refused = problem.errors;
  }

  #isElsewhere(node: FormNode): boolean {
    return this.#elsewhere.includes(node.path[0] ?? '');
  }

  #forget(node: FormNode): void {
    const { [node.path.join('.')]: _typed, ...others } = this.#unreadable;
    this.#unreadable = others;
    this.refused = this.refused.filter(({ path }) => !isAbove(this.tree, path, node));
  }
}

/** The station names fields by their keys; people know their titles. */
function worded(message: string, node: FormNode): string {
  if (node.kind !== 'group') return message;
  return message.replaceAll(/\b[a-z][a-z0-9_]*\b/g, (key) => {
    if (!key.includes('_')) return key;
    const member = [...node.members, ...leaves(node)].find(({ path }) => path.at(-1) === key);
    return member ? `“${member.title}”` : key;
  });
}

/** Deepest node that a path of the station leads to; list positions end at their list. */
export function nodeAt(tree: GroupNode, path: readonly string[]): FormNode | null {
  let node: FormNode = tree;
  for (const key of path) {
    if (node.kind !== 'group') return node;
    const next: FormNode | undefined = node.members.find((member) => member.path.at(-1) === key);
    if (!next) return node === tree ? null : node;
    node = next;
  }
  return node;
}

/** What a form calls a field that the station names `group.field`. */
export function fieldTitle(tree: GroupNode | undefined, field: string): string {
  const path = field.split('.');
  const node = tree ? nodeAt(tree, path) : null;
  return node?.path.length === path.length ? node.title : words(field);
}

/** Whether a path of the station leads to a field, to a group around it, or to no field. */
function isAbove(tree: GroupNode, path: readonly string[], node: FormNode): boolean {
  const found = nodeAt(tree, path);
  return (
    found === null || (found.path.length <= node.path.length && isPrefix(found.path, node.path))
  );
}

function isPrefix(short: readonly string[], long: readonly string[]): boolean {
  return short.every((key, i) => key === long[i]);
}

function leadsTo(tree: GroupNode, path: readonly string[], node: FormNode): boolean {
  return nodeAt(tree, path) === node;
}
