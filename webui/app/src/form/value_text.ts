import type { Json } from '../api/types';
import { plainNumber, screenUnit, type ScreenUnit } from '../text/unit';
import type { FormNode } from './schema';

/** Unit that a field's number is shown in; `null` for what is no number. */
export function unitOf(node: FormNode): ScreenUnit | null {
  return 'unit' in node ? screenUnit(node.unit, node.displayUnit) : null;
}

/** A field's value as it is typed: in the unit of the screen, without it. */
export function typedText(node: FormNode, value: Json | undefined): string {
  if (value === null || value === undefined) return '';
  const unit = unitOf(node);
  if (unit && typeof value === 'number') return plainNumber(value * unit.factor);
  if (unit && Array.isArray(value)) {
    return value.map((item) => plainNumber(Number(item) * unit.factor)).join(', ');
  }
  return typeof value === 'string' ? value : JSON.stringify(value);
}

/** A field's value by itself, in words where it has some. */
export function titleOf(node: FormNode, value: Json | undefined): string {
  if (typeof value === 'boolean') return value ? 'on' : 'off';
  const choice =
    node.kind === 'choice' ? node.choices.find((each) => each.value === value) : undefined;
  return choice?.title ?? typedText(node, value);
}

/** A field's value for a sentence or a list: with its unit, "none" where there is none. */
export function valueText(node: FormNode, value: Json | undefined): string {
  const text = titleOf(node, value);
  if (text === '') return 'none';
  const label = unitOf(node)?.label ?? '';
  const gap = label === '' || label.startsWith('°') ? '' : '\u00a0';
  return `${text}${gap}${label}`;
}
