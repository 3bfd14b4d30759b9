import type { Json } from '../api/types';
import { plainNumber, screenUnit } from '../text/unit';
import type { Bounds, FormNode, NumberNode, NumbersNode } from './schema';

/** What 0 means in a field, in the words of its help; "" where it is a number like any other. */
export function zeroMeaning(help: string): string {
  const found = /[;,.]\s+(0 [a-z][^.;,]*)/.exec(help.replace(/\s+/g, ' '))?.[1];
  return found === undefined ? '' : `${found}.`;
}

/** What is wrong with a value, in words, or `null`. */
export function fault(node: FormNode, value: Json | undefined): string | null {
  if (value === null || value === undefined) {
    return node.isNullable ? null : 'A value is needed.';
  }
  switch (node.kind) {
    case 'number':
      return numberFault(node, value);
    case 'numbers':
      return numbersFault(node, value);
    case 'choice':
      return node.choices.some((choice) => choice.value === value)
        ? null
        : 'Choose one of the list.';
    case 'text':
      return textFault(node.least, node.most, value);
    default:
      return null;
  }
}

function numberFault(node: NumberNode | NumbersNode, value: Json): string | null {
  if (typeof value !== 'number' || !Number.isFinite(value)) return 'A number is needed.';
  const unit = screenUnit(node.unit, node.displayUnit);
  const shown = (limit: number) =>
    `${plainNumber(limit * unit.factor)}${unit.label ? ` ${unit.label}` : ''}`;
  const { minimum, exclusiveMinimum, maximum, exclusiveMaximum } = node.bounds;
  if (node.isWhole && !Number.isInteger(value)) return 'A whole number is needed.';
  if (minimum !== undefined && value < minimum) return `At least ${shown(minimum)}.`;
  if (exclusiveMinimum !== undefined && value <= exclusiveMinimum) {
    return `More than ${shown(exclusiveMinimum)}.`;
  }
  if (maximum !== undefined && value > maximum) return `At most ${shown(maximum)}.`;
  if (exclusiveMaximum !== undefined && value >= exclusiveMaximum) {
    return `Less than ${shown(exclusiveMaximum)}.`;
  }
  return null;
}

function numbersFault(node: NumbersNode, value: Json): string | null {
  if (!Array.isArray(value)) return 'Numbers with commas between them are needed.';
  const { least, most } = node;
  if (least === most && value.length !== least) return `Exactly ${least} numbers are needed.`;
  if (value.length < least) return `At least ${least} numbers are needed.`;
  if (value.length > most) return `At most ${most} numbers are allowed.`;
  for (const item of value) {
    const found = numberFault(node, item);
    if (found !== null) return `Each number: ${found.charAt(0).toLowerCase()}${found.slice(1)}`;
  }
  return null;
}

function textFault(least: number, most: number, value: Json): string | null {
  if (typeof value !== 'string') return 'A text is needed.';
  if (value.length < least) return `At least ${least} characters.`;
  return value.length > most ? `At most ${most} characters.` : null;
}

/** "more than 0, at most 90 °" for the help of a field. */
export function boundsText(node: NumberNode | NumbersNode): string {
  const unit = screenUnit(node.unit, node.displayUnit);
  const { minimum, exclusiveMinimum, maximum, exclusiveMaximum }: Bounds = node.bounds;
  const shown = (limit: number) => plainNumber(limit * unit.factor);
  const parts: string[] = [];
  if (minimum !== undefined) parts.push(`at least ${shown(minimum)}`);
  if (exclusiveMinimum !== undefined) parts.push(`more than ${shown(exclusiveMinimum)}`);
  if (maximum !== undefined) parts.push(`at most ${shown(maximum)}`);
  if (exclusiveMaximum !== undefined) parts.push(`less than ${shown(exclusiveMaximum)}`);
  return parts.length === 0 ? '' : `${parts.join(', ')}${unit.label ? ` ${unit.label}` : ''}`;
}

/** A number as typed: comma or point, any spaces; `null` if it is none. */
export function parseNumber(typed: string): number | null {
  const plain = typed
    .trim()
    .replace('\u2212', '-')
    .replace(/^([^.]*),([^,.]*)$/, '$1.$2');
  if (!/^[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?$/i.test(plain)) return null;
  const value = Number(plain);
  return Number.isFinite(value) ? value : null;
}

/** A list as typed: separated by semicolons or spaces, or by commas with points as decimals. */
export function parseNumbers(typed: string): number[] | null {
  const parts = typed.split(/[;,\s]+/).filter(Boolean);
  const values = parts.map(parseNumber);
  return values.every((value) => value !== null) ? values : null;
}
