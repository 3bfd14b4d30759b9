import { expect, test } from 'vitest';
import type { ColumnRole, RecordingMapping } from '../../api/types';
import { ROLES, meaningOf, openTimes, withColumns, withMeaning } from './mapping';

test('a column keeps its name and unit while its meaning goes there and back', () => {
  const column = { name: 'T', role: 'variable', target: 'temperature', unit: 'degC' } as const;
  expect(withMeaning(column, meaningOf(column))).toEqual(column);
  for (const { key } of ROLES)
    expect(withMeaning(column, key)).toEqual({ ...column, role: key, target: '' });
});

const column = (name: string, role: ColumnRole) => ({ name, role, target: '', unit: '' });
const proposed = [
  {
    name: 'stamp',
    is_text: true,
    time_format: '',
    has_zone: false,
    cells: ['', '03.08.2026 10:00'],
  },
  { name: 'iso', is_text: true, time_format: 'iso', has_zone: true, cells: ['2026-08-03T10:00Z'] },
  { name: 'epoch', is_text: false, time_format: 'unix_s', has_zone: true, cells: ['1785751200'] },
].map((one) => ({ ...one, role: 'ignore', target: '', unit: '' }));
const none: RecordingMapping = { columns: [], time_format: '', is_utc: false };

test('how times are written follows the column that is said to tell them', () => {
  const chosen = (name: string) => withColumns(none, [column(name, 'time')], proposed);
  expect(chosen('iso')).toMatchObject({ time_format: 'iso', is_utc: true });
  expect(chosen('epoch')).toMatchObject({ time_format: 'unix_s', is_utc: false });
  expect(openTimes(chosen('iso'), proposed)).toEqual({ order: '', zone: '' });
  expect(openTimes(chosen('epoch'), proposed)).toEqual({ order: '', zone: '' });
  expect(openTimes(none, proposed)).toEqual({ order: '', zone: '' });
  const { order, zone } = openTimes(chosen('stamp'), proposed);
  expect(order).toContain('03.08.2026 10:00');
  expect(zone).toContain('UTC');
});

test('what was answered stays while another column changes', () => {
  const answered = { ...withColumns(none, [column('stamp', 'time')], proposed), is_utc: true };
  const changed = withColumns(answered, [column('stamp', 'time'), column('z', 'depth')], proposed);
  expect(changed.is_utc).toBe(true);
});
