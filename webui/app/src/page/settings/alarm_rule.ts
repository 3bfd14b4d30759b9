import type { AlarmRule, AlarmRuleEntry, Watched } from '../../api/alarm';
import type { JsonObject } from '../../api/types';
import { parseNumber } from '../../form/check';
import { LEVELS } from './channel_form';

type Level = (typeof LEVELS)[number];

/** Fields that a form makes from the schema; the others have their own rows. */
export const GENERATED = [
  'title',
  'text',
  'action',
  'hysteresis',
  'delay_s',
  'clear_after_s',
  'window_s',
];

export const KINDS: readonly { key: NonNullable<AlarmRule['kind']>; title: string }[] = [
  { key: 'limit', title: 'Beyond limits' },
  { key: 'catalogue', title: 'Beyond the limits of its channel' },
  { key: 'rate', title: 'Changes too fast, per minute' },
  { key: 'absence', title: 'Not told for too long, s' },
  { key: 'expression', title: 'Expression' },
];
export const SUPPRESSIONS = [
  { key: 'workshop', title: 'in the workshop' },
  { key: 'under_water', title: 'under water' },
  { key: 'planned_dive', title: 'while a dive is planned' },
] as const;
export const MODES = [
  'idle',
  'diving',
  'gliding',
  'spiralling',
  'swimming',
  'turning',
  'surfaced',
  'aborting',
  'holding',
  'tracking',
  'searching',
  'driven',
] as const;

/** What a person chooses of a rule beside the generated fields; numbers as text. */
export interface RuleDraft {
  key: string;
  kind: NonNullable<AlarmRule['kind']>;
  reads: string;
  expression: string;
  limits: Record<Level, { low: string; high: string }>;
  robots: string[];
  modes: string[];
  suppressed: string[];
}

const textOf = (value: number | null | undefined) => String(value ?? '');
const numberOf = (text: string) => (text.trim() === '' ? null : parseNumber(text));

export function draftOf(rule: AlarmRule | null): RuleDraft {
  const limits = Object.fromEntries(
    LEVELS.map((level) => {
      const known = rule?.limits?.find((one) => one.level === level);
      return [level, { low: textOf(known?.low), high: textOf(known?.high) }];
    }),
  ) as RuleDraft['limits'];
  return {
    key: rule?.key ?? '',
    kind: rule?.kind ?? 'limit',
    reads: rule?.reads ?? '',
    expression: rule?.expression ?? '',
    limits,
    robots: [...(rule?.robots ?? [])],
    modes: [...(rule?.modes ?? [])],
    suppressed: [...(rule?.suppressed ?? [])],
  };
}

/** The rule that the two parts of a form make. */
export function ruleOf(draft: RuleDraft, generated: JsonObject): AlarmRule {
  const limits = LEVELS.map((level) => ({
    level,
    low: numberOf(draft.limits[level].low),
    high: numberOf(draft.limits[level].high),
  })).filter(({ low, high }) => low !== null || high !== null);
  return {
    ...generated,
    key: draft.key.trim(),
    kind: draft.kind,
    reads: draft.kind === 'expression' ? '' : draft.reads,
    expression: draft.kind === 'expression' ? draft.expression : '',
    limits: draft.kind === 'catalogue' ? [] : limits,
    robots: draft.robots,
    modes: draft.modes,
    suppressed: draft.suppressed,
  } as unknown as AlarmRule;
}

/** What is typed as a limit and is no number. */
export function wrongLimit(draft: RuleDraft): string {
  const typed = LEVELS.flatMap((level) => [draft.limits[level].low, draft.limits[level].high]);
  const wrong = typed.map(String).find((text) => text.trim() !== '' && numberOf(text) === null);
  return wrong === undefined ? '' : `“${wrong}” is no number`;
}

/** The part of a rule's schema that a form is generated from. */
export function generatedSchema(schema: JsonObject): JsonObject {
  const properties = (schema.properties ?? {}) as JsonObject;
  const kept = Object.entries(properties).filter(([name]) => GENERATED.includes(name));
  return { ...schema, properties: Object.fromEntries(kept) };
}

/** The fields of a rule that a form was generated for. */
export function generatedOf(rule: AlarmRule | null): JsonObject {
  const presets = {
    title: '',
    text: '{robot}: {title} is {value}, {side} its limit of {limit}.',
    action: '',
    hysteresis: 0,
    delay_s: 0,
    clear_after_s: 0,
    window_s: 60,
  };
  if (rule === null) return presets;
  const known = Object.entries(rule).filter(([name]) => GENERATED.includes(name));
  return { ...presets, ...Object.fromEntries(known) };
}

/** What a rule watches and when it fires, in one line. */
export function conditionText({ rule }: AlarmRuleEntry, watched: readonly Watched[]): string {
  if (rule.kind === 'expression') return rule.expression ?? '';
  const known = watched.find(({ key }) => key === rule.reads);
  const name = known?.title ?? rule.reads ?? '';
  if (rule.kind === 'catalogue') return `${name}: limits of the channel`;
  const unit = rule.kind === 'absence' ? 's' : (known?.unit ?? '');
  const isState = unit === '' && (rule.limits ?? []).every(({ low }) => (low ?? null) === null);
  const ends = (rule.limits ?? []).map(({ level, low, high }) => {
    if (isState && (rule.limits ?? []).length === 1) return level;
    const gap = unit === '1' || unit === '' ? '' : ` ${unit}`;
    const below = (low ?? null) === null ? '' : `below ${low}${gap}`;
    const above = (high ?? null) === null ? '' : `above ${high}${gap}`;
    return `${level} ${[below, above].filter(Boolean).join(' or ')}`;
  });
  const what = { limit: name, rate: `${name}, per minute`, absence: `${name} not told` };
  return `${what[rule.kind ?? 'limit']}: ${ends.join(', ')}`;
}

/** Whether a rule is meant by what somebody looks for. */
export function isRuleFound({ rule, origin }: AlarmRuleEntry, wanted: string): boolean {
  const levels = (rule.limits ?? []).map(({ level }) => level);
  const text = [rule.title, rule.key, rule.reads, rule.expression, origin, ...levels]
    .join(' ')
    .toLowerCase();
  return wanted
    .toLowerCase()
    .split(/\s+/)
    .every((word) => text.includes(word));
}

/** One stretch in which a tried rule would have had its alarm stand. */
export interface Fired {
  robot: string;
  level: Level;
  begin: string;
  end: string | null;
  text: string;
}

export interface TrialResult {
  begin: string;
  end: string;
  values: number;
  robots: string[];
  fired: Fired[];
}

/** Where a stretch lies in the time that was tried, in percent; never too thin to be seen. */
export function placeOf(fired: Fired, trial: TrialResult): { left: number; width: number } {
  const begin = Date.parse(trial.begin);
  const span = Math.max(1, Date.parse(trial.end) - begin);
  const from = Math.max(0, Date.parse(fired.begin) - begin);
  const to = Date.parse(fired.end ?? trial.end) - begin;
  const width = Math.max(0.4, (100 * (to - from)) / span);
  return { left: Math.min(100 - width, (100 * from) / span), width };
}
