import type { Json, JsonObject } from '../api/types';
import { words } from '../text/word';

/** Bounds of a number; the exclusive ones must not be met. */
export interface Bounds {
  minimum?: number;
  exclusiveMinimum?: number;
  maximum?: number;
  exclusiveMaximum?: number;
}

interface Common {
  /** Keys that lead from the document's root to the value. */
  path: readonly string[];
  title: string;
  help: string;
  isAdvanced: boolean;
  isNullable: boolean;
  /** `undefined` where the schema names none. */
  default: Json | undefined;
}

export interface GroupNode extends Common {
  kind: 'group';
  members: FormNode[];
}

export interface NumberNode extends Common {
  kind: 'number';
  isWhole: boolean;
  unit: string;
  displayUnit: string | null;
  bounds: Bounds;
}

export interface NumbersNode extends Common {
  kind: 'numbers';
  isWhole: boolean;
  unit: string;
  displayUnit: string | null;
  /** Bounds of each number. */
  bounds: Bounds;
  least: number;
  most: number;
}

export interface ChoiceNode extends Common {
  kind: 'choice';
  choices: { value: Json; title: string }[];
}

export interface SwitchNode extends Common {
  kind: 'switch';
}

export interface TextNode extends Common {
  kind: 'text';
  least: number;
  most: number;
}

/** A value that no form fits; it is edited as JSON. */
export interface RawNode extends Common {
  kind: 'raw';
}

export type FormNode =
  GroupNode | NumberNode | NumbersNode | ChoiceNode | SwitchNode | TextNode | RawNode;

/** Turn a model's JSON Schema into the tree that a form is drawn from. */
export function formTree(schema: JsonObject): GroupNode {
  const node = readNode(schema, schema, []);
  if (node.kind !== 'group') throw new Error('the schema of a form must describe an object');
  return node;
}

function readNode(root: JsonObject, given: JsonObject, path: readonly string[]): FormNode {
  const { schema, isNullable } = resolved(root, given);
  const key = path.at(-1) ?? '';
  const common: Common = {
    path,
    title: titleOf(given, schema, key),
    help: plainHelp(text(schema.description)),
    isAdvanced: schema.advanced === true,
    isNullable,
    default: schema.default,
  };
  const choices = choicesOf(schema);
  if (choices) return { ...common, kind: 'choice', choices };
  switch (schema.type) {
    case 'object':
      // one that may be missing as a whole is set by whatever knows what it is
      return isNullable ? { ...common, kind: 'raw' } : group(root, schema, common);
    case 'number':
    case 'integer':
      return { ...common, kind: 'number', ...numeric(schema), isWhole: schema.type === 'integer' };
    case 'boolean':
      return { ...common, kind: 'switch' };
    case 'string':
      return {
        ...common,
        kind: 'text',
        least: size(schema.minLength, 0),
        most: size(schema.maxLength, Infinity),
      };
    case 'array':
      return list(root, schema, common);
    default:
      return { ...common, kind: 'raw' };
  }
}

/** A group that only refers to its model has the model's name for a title; its key says more. */
function titleOf(given: JsonObject, schema: JsonObject, key: string): string {
  const isNamedByModel = schema.type === 'object' && !text(given.title) && key !== '';
  return (isNamedByModel ? '' : text(schema.title)) || words(key);
}

function group(root: JsonObject, schema: JsonObject, common: Common): FormNode {
  if (!isObject(schema.properties)) return { ...common, kind: 'raw' };
  const own = isObject(common.default) ? common.default : {};
  const members = Object.entries(schema.properties)
    .filter((entry): entry is [string, JsonObject] => isObject(entry[1]))
    .map(([key, member]) => {
      const node = readNode(root, member, [...common.path, key]);
      return key in own ? withDefault(node, own[key]) : node;
    });
  return { ...common, kind: 'group', members };
}

/** A group's own default speaks for its members. */
function withDefault(node: FormNode, value: Json | undefined): FormNode {
  if (node.kind !== 'group' || !isObject(value)) return { ...node, default: value };
  return {
    ...node,
    default: value,
    members: node.members.map((member) => {
      const key = member.path.at(-1) ?? '';
      return key in value ? withDefault(member, value[key]) : member;
    }),
  };
}

function list(root: JsonObject, schema: JsonObject, common: Common): FormNode {
  const prefix = Array.isArray(schema.prefixItems) ? schema.prefixItems : null;
  const first = prefix ? prefix[0] : schema.items;
  if (!isObject(first)) return { ...common, kind: 'raw' };
  const item = resolved(root, first).schema;
  if (item.type !== 'number' && item.type !== 'integer') return { ...common, kind: 'raw' };
  return {
    ...common,
    kind: 'numbers',
    ...numeric({ ...item, ...units(schema) }),
    isWhole: item.type === 'integer',
    least: size(schema.minItems, prefix?.length ?? 0),
    most: size(schema.maxItems, prefix?.length ?? Infinity),
  };
}

function units(schema: JsonObject): JsonObject {
  const { unit = '', display_unit = null } = schema;
  return { unit, display_unit };
}

function numeric(schema: JsonObject): { unit: string; displayUnit: string | null; bounds: Bounds } {
  const bounds: Bounds = {};
  for (const name of ['minimum', 'exclusiveMinimum', 'maximum', 'exclusiveMaximum'] as const) {
    const value = schema[name];
    if (typeof value === 'number') bounds[name] = value;
  }
  const { unit, display_unit: displayUnit } = schema;
  return { unit: text(unit), displayUnit: text(displayUnit) || null, bounds };
}

function choicesOf(schema: JsonObject): ChoiceNode['choices'] | null {
  const values = Array.isArray(schema.enum)
    ? schema.enum
    : schema.const === undefined
      ? null
      : [schema.const];
  const titles = isObject(schema.choice_titles) ? schema.choice_titles : {};
  return values?.map((value) => ({ value, title: choiceTitle(value, titles) })) ?? null;
}

function choiceTitle(value: Json, titles: JsonObject): string {
  if (typeof value !== 'string') return JSON.stringify(value);
  return text(titles[value]) || words(value);
}

/** Follow references and unwrap "or null"; what stands beside a reference wins over its target. */
function resolved(
  root: JsonObject,
  given: JsonObject,
): { schema: JsonObject; isNullable: boolean } {
  let schema = given;
  let isNullable = false;
  for (let depth = 0; depth < 16; depth++) {
    const { $ref, anyOf, allOf, ...beside } = schema;
    const options = Array.isArray(anyOf) ? anyOf.filter(isObject) : [];
    const solid = options.filter((option) => option.type !== 'null');
    const only = Array.isArray(allOf) && allOf.length === 1 ? allOf[0] : solid[0];
    if (typeof $ref === 'string') schema = { ...target(root, $ref), ...beside };
    else if (isObject(only) && (solid.length === 1 || Array.isArray(allOf))) {
      isNullable ||= solid.length < options.length;
      schema = { ...only, ...beside };
    } else return { schema, isNullable };
  }
  return { schema: {}, isNullable };
}

function target(root: JsonObject, reference: string): JsonObject {
  let found: Json | undefined = root;
  for (const part of reference.replace(/^#\//, '').split('/')) {
    found = isObject(found) ? found[part] : undefined;
  }
  return isObject(found) ? found : {};
}

export function isObject(value: Json | undefined): value is JsonObject {
  return typeof value === 'object' && value !== null && !Array.isArray(value);
}

function text(value: Json | undefined): string {
  return typeof value === 'string' ? value : '';
}

function size(value: Json | undefined, otherwise: number): number {
  return typeof value === 'number' ? value : otherwise;
}

/** Help of a setting without the marks of its source: what stands in them is a word. */
function plainHelp(help: string): string {
  return help.replace(/``([^`]*)``/g, (_, word: string) => word.replaceAll('_', ' '));
}
