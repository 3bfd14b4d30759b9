import { expect, test } from 'vitest';
import { ROLES, meaningOf, withMeaning } from './mapping';

test('a column keeps its name and unit while its meaning goes there and back', () => {
  const column = { name: 'T', role: 'variable', target: 'temperature', unit: 'degC' } as const;
  expect(withMeaning(column, meaningOf(column))).toEqual(column);
  for (const { key } of ROLES)
    expect(withMeaning(column, key)).toEqual({ ...column, role: key, target: '' });
});
