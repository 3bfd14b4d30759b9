import type {
  ColumnRole,
  MappedColumn,
  RecordingMapping,
  RecordingProposal,
} from '../../api/types';

type Columns = RecordingProposal['columns'];
const TIMES: readonly ColumnRole[] = ['time', 'date'];

/** What a column may be beside a measurement, in the order of a list. */
export const ROLES: readonly { key: ColumnRole; title: string }[] = [
  { key: 'ignore', title: 'Left out' },
  { key: 'other', title: 'Other series' },
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

const timeColumn = (columns: readonly MappedColumn[]) =>
  columns.find((one) => TIMES.includes(one.role));

/** The mapping with other columns; how times are written follows the column that tells them. */
export function withColumns(
  mapping: RecordingMapping,
  columns: readonly MappedColumn[],
  proposed: Columns,
): RecordingMapping {
  const now = timeColumn(columns)?.name;
  const changed = { ...mapping, columns: [...columns] };
  if (now === undefined || now === timeColumn(mapping.columns)?.name) return changed;
  const found = proposed.find((one) => one.name === now);
  return {
    ...changed,
    time_format: (found?.time_format ?? '') as NonNullable<RecordingMapping['time_format']>,
    is_utc: (found?.is_text ?? false) && (found?.has_zone ?? false),
  };
}

/** What the times of a file leave open, as questions to a person; empty where nothing is. */
export function openTimes(
  mapping: RecordingMapping,
  proposed: Columns,
): { order: string; zone: string } {
  const name = timeColumn(mapping.columns)?.name;
  const found = proposed.find((one) => one.name === name);
  if (!found?.is_text) return { order: '', zone: '' };
  const like = `like “${found.cells.find((cell) => cell !== '') ?? ''}”`;
  return {
    order: found.time_format === '' ? `Times are written ${like}: day or month first?` : '',
    zone: found.has_zone ? '' : `Times ${like} say no zone: they are UTC`,
  };
}
