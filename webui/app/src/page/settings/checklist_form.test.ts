import { expect, test } from 'vitest';
import { draftOf, faultsByItem, keyOf, newItem, templateOf } from './checklist_form';

test('a new item gets a key of its text that no other has', () => {
  expect(keyOf('The hull is closed', [])).toBe('the_hull_is_closed');
  expect(keyOf('2 O-rings!', ['o_rings'])).toBe('o_rings_2');
  expect(keyOf('?!', [])).toBe('item');
});

test('a template comes out of its draft as it went in', () => {
  const template = {
    title: 'Camera',
    act: 'start' as const,
    robots: 'real' as const,
    waters: ['tank' as const],
    valid_h: 6,
    items: [
      { key: 'lens', text: 'The lens is clean', help: 'Wipe it.', kind: 'manual' as const,
        blocking: false, check: '', limit: null },
      { key: 'battery', text: 'Charged', help: '', kind: 'automatic' as const, blocking: true,
        check: 'battery', limit: 50 },
    ],
  }; // prettier-ignore
  expect(templateOf(draftOf(template))).toEqual(template);
});

test('what is added is manual until a check is chosen, and an empty limit is the usual one', () => {
  const draft = draftOf(null);
  draft.items = [
    { ...newItem(), text: 'Door shut' },
    { ...newItem(), text: 'Dry', check: 'leak' },
  ];
  const items = templateOf(draft).items;
  expect(items.map(({ key, kind, limit }) => [key, kind, limit])).toEqual([
    ['door_shut', 'manual', null],
    ['leak', 'automatic', null],
  ]);
});

test('a fault stands at the item that it is about', () => {
  const errors = [
    { path: ['template', 'items', 1, 'limit'], message: 'too much' },
    { path: ['template', 'title'], message: 'empty' },
  ];
  expect(faultsByItem(errors as never)).toEqual({ 1: 'too much', [-1]: 'empty' });
});
