/** The numbers of a design in words and in units of the screen, and which of them a template asks. */
import type { NewTemplate } from '../../api/design';
import { plainNumber, screenUnit } from '../../text/unit';
import { ruleOf, spotsOf, type Design, type Waypoint } from './document';
import { naming } from './spots';

/** A number that a form asks for: limits in the unit of the document. */
export interface NumberRule {
  key: string;
  label: string;
  /** Of the document: `m`, `rad`, `s`, `m/s`, or none. */
  unit: string;
  low: number;
  high: number;
  isWhole?: boolean;
}

const DEGREE = Math.PI / 180;
const FAR_M = 1e6;
const DEEP_M = 12_000;
const MONTH_S = 2_592_000;
const FAST_M_S = 5;

/** Numbers of the contents, whichever has them. */
export const CONTENT_NUMBERS: readonly NumberRule[] = [
  { key: 'depth_m', label: 'Depth of the floor', unit: 'm', low: 0.01, high: DEEP_M },
  { key: 'length_m', label: 'Length', unit: 'm', low: 0.01, high: FAR_M },
  { key: 'radius_m', label: 'Radius', unit: 'm', low: 0.01, high: FAR_M },
  { key: 'spacing_m', label: 'Spacing', unit: 'm', low: 0.01, high: FAR_M },
  { key: 'heading_rad', label: 'Heading', unit: 'rad', low: -7, high: 7 },
  { key: 'turns', label: 'Turns', unit: '', low: 1, high: 60, isWhole: true },
  { key: 'lines', label: 'Lines', unit: '', low: 2, high: 36, isWhole: true },
  { key: 'passes', label: 'Passes', unit: '', low: 1, high: 50, isWhole: true },
  { key: 'repeats', label: 'Times', unit: '', low: 1, high: 100, isWhole: true },
  { key: 'duration_s', label: 'Duration', unit: 's', low: 1, high: MONTH_S },
];

const TURNS: readonly NumberRule[] = [
  { key: 'shallow_m', label: 'Shallow turn', unit: 'm', low: 0, high: DEEP_M },
  { key: 'deep_m', label: 'Deep turn', unit: 'm', low: 0.01, high: DEEP_M },
  { key: 'glide_angle_rad', label: 'Glide angle', unit: 'rad', low: DEGREE, high: 89 * DEGREE },
];

const MANNER_NUMBERS: readonly NumberRule[] = [
  ...TURNS,
  { key: 'glide_speed_m_s', label: 'Vertical speed', unit: 'm/s', low: 0.001, high: FAST_M_S },
  { key: 'swim_speed_m_s', label: 'Swimming speed', unit: 'm/s', low: 0.001, high: FAST_M_S },
  { key: 'floor_clearance_m', label: 'Above the floor', unit: 'm', low: 0, high: DEEP_M },
];

const SURFACING_NUMBERS: readonly NumberRule[] = [
  { key: 'every_s', label: 'Comes up at least every', unit: 's', low: 1, high: MONTH_S },
  {
    key: 'max_uncertainty_m',
    label: 'Comes up if less certain than',
    unit: 'm',
    low: 0.001,
    high: FAR_M,
  },
  {
    key: 'samples_waiting',
    label: 'Comes up if samples wait',
    unit: '',
    low: 1,
    high: 1e6,
    isWhole: true,
  },
];

const SPOT_NUMBERS: readonly NumberRule[] = [
  ...TURNS,
  { key: 'speed_m_s', label: 'Speed', unit: 'm/s', low: 0.001, high: FAST_M_S },
];

/** How a number of the document is shown; durations in minutes. */
export function shownIn(unit: string): { label: string; factor: number } {
  if (unit === 'rad') return screenUnit('rad', 'deg');
  return unit === 's' ? screenUnit('s', 'min') : screenUnit(unit);
}

/** A number of a document that a template may ask for anew. */
export interface Candidate extends NumberRule {
  /** Where it stands: JSON pointers, several where several waypoints say the same. */
  paths: string[];
  value: number | null;
}

/** Waypoints that one number of a template may set. */
const PATHS_MAX = 64;

/** The numbers of a design that a template may ask for. */
export function candidatesOf(
  design: Design,
  channelOf: (key: string) => { title: string; unit: string } | undefined = () => undefined,
): Candidate[] {
  const { content, manner, surfacing } = design;
  const isWay = content.kind === 'waypoints';
  return [
    ...numbersOf('/content', content, CONTENT_NUMBERS),
    ...(isWay ? spotNumbers(content.waypoints) : placeNumbers(design)),
    ...numbersOf('/manner', manner, MANNER_NUMBERS),
    ...numbersOf('/surfacing', surfacing, SURFACING_NUMBERS),
    ...surfacing.on_value.map(({ channel, side, value }, i) => {
      const known = channelOf(channel);
      const label = `Comes up if ${known?.title ?? channel} is ${side}`;
      const rule = { key: `on_value_${i}`, label, unit: known?.unit ?? '', low: -1e12, high: 1e12 };
      return { ...rule, paths: [`/surfacing/on_value/${i}/value`], value };
    }),
  ];
}

function numbersOf(at: string, part: object, rules: readonly NumberRule[]): Candidate[] {
  const values = part as Readonly<Record<string, number | null | undefined>>;
  return rules
    .filter(({ key }) => key in part)
    .map((rule) => ({ ...rule, paths: [`${at}/${rule.key}`], value: values[rule.key] ?? null }));
}

const PLACES: Readonly<Record<string, string>> = {
  along_isobath: 'near',
  mooring: 'place',
  station_keep: 'place',
  reference: 'origin',
};

function placeNumbers({ content }: Design): Candidate[] {
  const [spot] = spotsOf(content);
  const { shape, noun } = ruleOf(content);
  if (shape !== 'place' || !spot) return [];
  const at = `/content/${PLACES[content.kind] ?? 'centre'}`;
  const rule = { unit: 'm', low: -FAR_M, high: FAR_M };
  return [
    { ...rule, key: 'north_m', label: `North of the ${noun}`, paths: [`${at}/north_m`], value: spot.north_m },
    { ...rule, key: 'east_m', label: `East of the ${noun}`, paths: [`${at}/east_m`], value: spot.east_m },
  ]; // prettier-ignore
}

/** What waypoints say of themselves: those that say the same are asked for once. */
function spotNumbers(waypoints: readonly Waypoint[]): Candidate[] {
  return SPOT_NUMBERS.flatMap((rule) => {
    const saying = new Map<number, number[]>();
    waypoints.forEach((one, i) => {
      const value = one[rule.key as 'deep_m'];
      if (typeof value === 'number') saying.set(value, [...(saying.get(value) ?? []), i]);
    });
    return [...saying]
      .filter(([, indexes]) => indexes.length <= PATHS_MAX)
      .map(([value, indexes]) => ({
        ...rule,
        key: `${rule.key}_of_${indexes[0] ?? 0}`,
        label: `${rule.label} of${naming('', 'waypoint', new Set(indexes))}`,
        paths: indexes.map((i) => `/content/waypoints/${i}/${rule.key}`),
        value,
      }));
  });
}

/** A number that was chosen to be asked for anew, in the unit of the document. */
export interface Asked {
  title: string;
  /** Without one it must be said each time. */
  usual: number | null;
  low: number | null;
  high: number | null;
}

/** What is wrong with a number that is asked for; empty where nothing is. */
export function askedFault({ title, usual, low, high }: Asked, unit: string): string {
  const { label, factor } = shownIn(unit);
  const shown = (value: number) =>
    `${plainNumber(value * factor)}${label && label !== '°' ? ' ' : ''}${label}`;
  if (title.trim() === '') return 'It needs a name.';
  if (low !== null && high !== null && low > high) {
    return `The least, ${shown(low)}, exceeds the most, ${shown(high)}.`;
  }
  if (usual !== null && low !== null && usual < low) {
    return `The usual value, ${shown(usual)}, is less than the least, ${shown(low)}.`;
  }
  if (usual !== null && high !== null && usual > high) {
    return `The usual value, ${shown(usual)}, is more than the most, ${shown(high)}.`;
  }
  return '';
}

/** What the station is sent of chosen numbers. */
export function parametersOf(
  candidates: readonly Candidate[],
  asked: Readonly<Record<string, Asked>>,
): NonNullable<NewTemplate['parameters']> {
  return candidates.flatMap(({ key, unit, paths }) => {
    const one = asked[key];
    if (!one) return [];
    const { title, usual, low, high } = one;
    return [{ key, title: title.trim(), unit, default: usual, low, high, paths }];
  });
}
