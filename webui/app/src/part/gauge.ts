import type { CatalogueChannel, Channel } from '../api/types';
import { fixed, screenUnit } from '../text/unit';
import { words } from '../text/word';

export type Catalogue = Readonly<Record<string, CatalogueChannel>>;

/** Channels that are shown together, in the order of a screen. */
export type GaugeGroup = 'flight' | 'water' | 'housekeeping';

/** How one channel is shown, as the catalogue of channels says. */
export interface GaugeRow {
  key: string;
  title: string;
  help: string;
  /** Unit on the screen where the station names none. */
  displayUnit: string | null;
  decimals: number;
  group: GaugeGroup;
  /** What a switch is called at 0 and at 1; `null` of what is no switch. */
  switchWords: readonly [string, string] | null;
  alarms: CatalogueChannel['alarms'];
}

const GROUPS: Record<CatalogueChannel['kind'], GaugeGroup> = {
  flight: 'flight',
  field: 'water',
  housekeeping: 'housekeeping',
  switch: 'housekeeping',
};

export const GROUP_TITLES: Record<GaugeGroup, string> = {
  flight: 'Flight',
  water: 'Water',
  housekeeping: 'Housekeeping',
};

/** Row of a channel; one that the catalogue does not have is shown with what the station says. */
export function gaugeRow(catalogue: Catalogue, key: string): GaugeRow {
  const known = catalogue[key];
  if (!known) {
    return {
      key,
      title: words(key),
      help: '',
      displayUnit: null,
      decimals: 2,
      group: 'water',
      switchWords: null,
      alarms: [],
    };
  }
  return {
    key,
    title: known.title,
    help: known.help,
    displayUnit: known.display_unit,
    decimals: known.decimals,
    group: GROUPS[known.kind],
    switchWords: known.kind === 'switch' ? known.switch_words : null,
    alarms: known.alarms,
  };
}

/** The rows of the channels that a robot reports, in the catalogue's order. */
export function gaugeRows(
  catalogue: Catalogue,
  channels: Readonly<Record<string, Channel>>,
): GaugeRow[] {
  const known = Object.keys(catalogue).filter((key) => key in channels);
  const others = Object.keys(channels).filter((key) => !(key in catalogue));
  return [...known, ...others].map((key) => gaugeRow(catalogue, key));
}

export interface Reading {
  text: string;
  unit: string;
}

/** Value of a channel as its gauge shows it. */
export function reading(
  gauge: GaugeRow,
  value: number,
  unit: string,
  displayUnit?: string | null,
): Reading {
  if (gauge.switchWords) return { text: gauge.switchWords[value >= 0.5 ? 1 : 0], unit: '' };
  const shown = screenUnit(unit, displayUnit ?? gauge.displayUnit);
  const onScreen = value * shown.factor;
  if (gauge.key === 'heading_rad') {
    const whole = ((Math.round(onScreen) % 360) + 360) % 360;
    return { text: String(whole).padStart(3, '0'), unit: shown.label };
  }
  return { text: fixed(onScreen, decimalsFor(gauge, onScreen)), unit: shown.label };
}

/** The gravest level whose limit a value is beyond; `null` where it is normal. */
export function alarmLevel(
  gauge: GaugeRow,
  value: number,
): CatalogueChannel['alarms'][number]['level'] | null {
  const crossed = gauge.alarms.find(
    ({ low, high }) => (low !== null && value < low) || (high !== null && value > high),
  );
  return crossed?.level ?? null;
}

/** Beyond which values a channel raises alarms, for a title. */
export function limitWords(gauge: GaugeRow, unit: string): string {
  const label = screenUnit(unit, gauge.displayUnit).label;
  return gauge.alarms
    .map(({ level, low, high }) => {
      const ends = [
        low === null ? '' : `below ${low} ${label}`,
        high === null ? '' : `above ${high} ${label}`,
      ];
      return `${level} ${ends.filter(Boolean).join(' or ')}`.trim();
    })
    .join(', ');
}

/** Large values need fewer decimals; a well known position is known to millimetres. */
function decimalsFor(gauge: GaugeRow, value: number): number {
  const size = Math.abs(value);
  if (gauge.key === 'position_std_m' && size < 0.1) return gauge.decimals + 1;
  const spare = size >= 1000 ? 2 : size >= 100 ? 1 : 0;
  return Math.max(0, gauge.decimals - (gauge.group === 'flight' ? spare : 0));
}
