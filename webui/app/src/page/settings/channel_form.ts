import type { CatalogueChannel, ChannelChanges, NewChannel } from '../../api/types';
import type { FieldError } from '../../api/problem';
import { parseNumber } from '../../form/check';

export type Level = CatalogueChannel['alarms'][number]['level'];

/** What a person types of a channel; numbers as text, so that an empty field is no end. */
export interface ChannelDraft {
  key: string;
  title: string;
  unit: string;
  kind: 'field' | 'housekeeping' | 'switch';
  wireNumber: string;
  low: string;
  high: string;
  scale: 'linear' | 'log';
  canMap: boolean;
  standardName: string;
  colourMap: CatalogueChannel['colour_map'];
  decimals: string;
  alarms: Record<Level, { low: string; high: string }>;
  help: string;
}

/** The gravest first. */
export const LEVELS: readonly Level[] = ['critical', 'severe', 'warning', 'watch', 'info'];
export const COLOUR_MAPS: readonly CatalogueChannel['colour_map'][] = [
  'viridis',
  'cividis',
  'magma',
];

const none = () => ({ low: '', high: '' });
const textOf = (value: number | null | undefined) => (value === null ? '' : String(value ?? ''));
const numberOf = (text: string) => (text.trim() === '' ? null : parseNumber(text));

/** A form as it begins: empty, or a channel as it is. */
export function draftOf(channel: CatalogueChannel | null): ChannelDraft {
  const alarms = {
    critical: none(),
    severe: none(),
    warning: none(),
    watch: none(),
    info: none(),
  };
  for (const { level, low, high } of channel?.alarms ?? []) {
    alarms[level] = { low: textOf(low), high: textOf(high) };
  }
  const kind = channel?.kind ?? 'field';
  return {
    key: channel?.key ?? '',
    title: channel?.title ?? '',
    unit: channel?.unit ?? '',
    kind: kind === 'flight' ? 'field' : kind,
    wireNumber: textOf(channel?.wire_number),
    low: textOf(channel?.low),
    high: textOf(channel?.high),
    scale: channel?.scale ?? 'linear',
    canMap: channel?.can_map ?? true,
    standardName: channel?.standard_name ?? '',
    colourMap: channel?.colour_map ?? 'viridis',
    decimals: textOf(channel?.decimals ?? 2),
    alarms,
    help: channel?.help ?? '',
  };
}

/** The alarm limits of a form; a level without an end has none. */
function alarmsOf(draft: ChannelDraft): NonNullable<NewChannel['alarms']> {
  return LEVELS.map((level) => ({
    level,
    low: numberOf(draft.alarms[level].low),
    high: numberOf(draft.alarms[level].high),
  })).filter(({ low, high }) => low !== null || high !== null);
}

/** What the station is asked to add. */
export function newChannelOf(draft: ChannelDraft): NewChannel {
  return {
    key: draft.key.trim(),
    title: draft.title.trim(),
    unit: draft.unit.trim() || '1',
    kind: draft.kind,
    wire_number: numberOf(draft.wireNumber),
    low: numberOf(draft.low),
    high: numberOf(draft.high),
    scale: draft.scale,
    can_map: draft.canMap && draft.kind === 'field',
    standard_name: draft.standardName.trim() || null,
    colour_map: draft.colourMap,
    decimals: numberOf(draft.decimals) ?? 2,
    alarms: alarmsOf(draft),
    help: draft.help.trim(),
  };
}

/** What differs from the channel as it is; what is fixed is left out. */
export function changesOf(channel: CatalogueChannel, draft: ChannelDraft): ChannelChanges {
  const asIs = newChannelOf(draftOf(channel));
  const wished = newChannelOf(draft);
  const fixed = new Set(
    channel.origin === 'own' ? ['key'] : ['key', 'unit', 'kind', 'wire_number'],
  );
  const changed = Object.entries(wished).filter(
    ([name, value]) =>
      !fixed.has(name) && JSON.stringify(value) !== JSON.stringify(asIs[name as keyof NewChannel]),
  );
  return Object.fromEntries(changed);
}

/** What is typed and is no number, by the name of the field in the station's document. */
export function notNumbers(draft: ChannelDraft): Record<string, string> {
  const typed = {
    wire_number: [draft.wireNumber],
    low: [draft.low],
    high: [draft.high],
    decimals: [draft.decimals],
    alarms: LEVELS.flatMap((level) => [draft.alarms[level].low, draft.alarms[level].high]),
  };
  const faults = Object.entries(typed).flatMap(([name, texts]) => {
    const wrong = texts.map(String).find((text) => text.trim() !== '' && numberOf(text) === null);
    return wrong === undefined ? [] : [[name, `“${wrong}” is no number`] as const];
  });
  return Object.fromEntries(faults);
}

/** What is wrong with each field, by its name in the station's document. */
export function faultsByField(errors: readonly FieldError[]): Record<string, string> {
  const faults: Record<string, string> = {};
  for (const { path, message } of errors) {
    const name = path[0] ?? '';
    faults[name] = faults[name] ? `${faults[name]}; ${message}` : message;
  }
  return faults;
}

/** Whether a channel is meant by what somebody looks for. */
export function isFound(channel: CatalogueChannel, wanted: string): boolean {
  const text = [channel.title, channel.key, channel.unit, channel.kind, channel.origin]
    .join(' ')
    .toLowerCase();
  return wanted
    .toLowerCase()
    .split(/\s+/)
    .every((word) => text.includes(word));
}
