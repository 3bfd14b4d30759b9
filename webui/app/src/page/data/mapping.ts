import type { ColumnRole, MappedColumn } from '../../api/types';

/** What a column may be beside a measurement, in the order of a list. */
export const ROLES: readonly { key: ColumnRole; title: string }[] = [
  { key: 'ignore', title: 'Left out' },
  { key: 'time', title: 'Time' },
  { key: 'date', title: 'Date' },
  { key: 'clock', title: 'Time of day' },
  { key: 'latitude', title: 'Latitude' },
  { key: 'longitude', title: 'Longitude' },
  { key: 'depth', title: 'Depth' },
  { key: 'pressure', title: 'Pressure, as depth' },
  { key: 'altitude', title: 'Height, up positive' },
  { key: 'fix_latitude', title: 'Latitude of a fix' },
  { key: 'fix_longitude', title: 'Longitude of a fix' },
];

/** What a column becomes, as one word of a list. */
export function meaningOf(column: MappedColumn): string {
  return column.target ? `${column.role}:${column.target}` : column.role;
}

/** The column with another meaning. */
export function withMeaning(column: MappedColumn, meaning: string): MappedColumn {
  const [role, target = ''] = meaning.split(':');
  return { ...column, role: role as ColumnRole, target };
}
