import type { Json, JsonObject } from '../api/types';
import { isObject, type FormNode } from './schema';

/** Value at a path; `undefined` where there is none. */
export function valueAt(document: Json | undefined, path: readonly string[]): Json | undefined {
  let value = document;
  for (const key of path) value = isObject(value) ? value[key] : undefined;
  return value;
}

/** The same document with one value replaced; what does not change stays the same object. */
export function withValue(document: JsonObject, path: readonly string[], value: Json): JsonObject {
  const [key, ...rest] = path;
  if (key === undefined) return document;
  if (rest.length === 0) return { ...document, [key]: value };
  const inner = document[key];
  return { ...document, [key]: withValue(isObject(inner) ? inner : {}, rest, value) };
}

export function isSame(a: Json | undefined, b: Json | undefined): boolean {
  if (a === b) return true;
  if (Array.isArray(a) && Array.isArray(b)) {
    return a.length === b.length && a.every((value, i) => isSame(value, b[i]));
  }
  if (isObject(a) && isObject(b)) {
    const keys = new Set([...Object.keys(a), ...Object.keys(b)]);
    return [...keys].every((key) => isSame(a[key], b[key]));
  }
  return false;
}

/**
 * The members of `document` that differ from `base`, as a patch that leads from one to the other
 * (RFC 7396): null removes what `document` lacks.
 */
export function difference(base: JsonObject, document: JsonObject): JsonObject {
  const patch: JsonObject = {};
  for (const [key, value] of Object.entries(document)) {
    const known = base[key];
    if (isSame(known, value)) continue;
    patch[key] = isObject(known) && isObject(value) ? difference(known, value) : value;
  }
  for (const key of Object.keys(base)) if (!(key in document)) patch[key] = null;
  return patch;
}

/** Every node below a group that holds one value. */
export function leaves(node: FormNode): Exclude<FormNode, { kind: 'group' }>[] {
  return node.kind === 'group' ? node.members.flatMap(leaves) : [node];
}
