import type { FieldError } from '../../api/problem';
import type { ChecklistCheck, ChecklistItem, ChecklistTemplate } from '../../api/types';

export const ACTS: Record<ChecklistTemplate['act'], string> = {
  start: 'before a plan is started',
  launch: 'before a launch, and its first plan',
  daily: 'each day',
  recovery: 'at recovery',
};
export const WATERS = ['tank', 'lake', 'sea'] as const;

/** An item as it is edited: its limit as typed. */
export interface ItemDraft {
  /** Empty of a new one, whose key follows from its text. */
  key: string;
  text: string;
  help: string;
  /** Key of its check; "" of a manual item. */
  check: string;
  limit: string;
  blocking: boolean;
}

export interface TemplateDraft {
  title: string;
  act: ChecklistTemplate['act'];
  robots: NonNullable<ChecklistTemplate['robots']>;
  waters: string[];
  validH: string;
  items: ItemDraft[];
}

const KEY_LENGTH_MAX = 40;

/** A key of lower-case letters, digits and underscores that begins with a letter. */
export function keyOf(text: string, taken: readonly string[]): string {
  const plain = text
    .toLowerCase()
    .replace(/[^a-z0-9]+/g, '_')
    .replace(/^[^a-z]+/, '')
    .slice(0, KEY_LENGTH_MAX - 3)
    .replace(/_+$/, '');
  const first = plain || 'item';
  let key = first;
  for (let number = 2; taken.includes(key); number += 1) key = `${first}_${number}`;
  return key;
}

export function newItem(): ItemDraft {
  return { key: '', text: '', help: '', check: '', limit: '', blocking: true };
}

export function draftOf(template: ChecklistTemplate | null): TemplateDraft {
  if (template === null) {
    return {
      title: '',
      act: 'start',
      robots: 'all',
      waters: [],
      validH: '12',
      items: [newItem()],
    };
  }
  return {
    title: template.title,
    act: template.act,
    robots: template.robots ?? 'all',
    waters: [...(template.waters ?? [])],
    validH: String(template.valid_h ?? 12),
    items: template.items.map((item) => ({
      key: item.key,
      text: item.text,
      help: item.help ?? '',
      check: item.check ?? '',
      limit: item.limit === null || item.limit === undefined ? '' : String(item.limit),
      blocking: item.blocking ?? true,
    })),
  };
}

/** The template that a draft says; keys of new items follow from their texts. */
export function templateOf(draft: TemplateDraft): ChecklistTemplate {
  const keys = draft.items.map(({ key }) => key).filter((key) => key !== '');
  const items = draft.items.map((item): ChecklistItem => {
    const key = item.key || keyOf(item.check || item.text, keys);
    if (!item.key) keys.push(key);
    const limit = item.limit.trim();
    return {
      key,
      text: item.text,
      help: item.help,
      kind: item.check ? 'automatic' : 'manual',
      blocking: item.blocking,
      check: item.check,
      limit: item.check && limit ? Number(limit) : null,
    };
  });
  return {
    title: draft.title,
    act: draft.act,
    robots: draft.robots,
    waters: WATERS.filter((water) => draft.waters.includes(water)),
    valid_h: Number(draft.validH),
    items,
  };
}

/** What is wrong with which item, by its place, and what with the rest, under -1. */
export function faultsByItem(errors: readonly FieldError[]): Record<number, string> {
  const found: Record<number, string> = {};
  for (const { path, message } of errors) {
    const at = path.indexOf('items');
    const number = at < 0 ? -1 : Number(path[at + 1] ?? -1);
    found[number] = [found[number], message].filter(Boolean).join('; ');
  }
  return found;
}

/** What the number of a check means, such as "at least 30 %". */
export function usualLimit(checks: readonly ChecklistCheck[], key: string): string {
  const limit = checks.find((check) => check.key === key)?.limit;
  return limit ? `${limit.title.toLowerCase()} ${limit.usual} ${limit.unit}` : '';
}
