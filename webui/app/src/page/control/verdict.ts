import type { CostPoint, IdentifiedParameter, LeftOut, RunState, Verdict } from '../../api/types';
import { clockTime, duration } from '../../text/time';
import { compact, fixed, plainNumber, screenUnit } from '../../text/unit';
import { capital, type Tone } from '../../text/word';

interface VerdictWord {
  text: string;
  tone: Tone;
}

const VERDICTS: Record<Verdict, Tone> = {
  identified: 'ok',
  weak: 'watch',
  fixed: 'plain',
  'not identifiable': 'watch',
};

/** What the data say of a parameter: the verdict, how far off it may be, and why. */
export interface VerdictText extends VerdictWord {
  /** "±12 %"; empty where the data set no bounds. */
  figure: string;
  /** A sentence, or nothing. */
  reason: string;
}

export function verdictText({ verdict, reason }: IdentifiedParameter): VerdictText {
  const said = signed(reason.trim().replace(/\.$/, ''));
  const [, figure = '', rest = ''] = /^(±[\d.]+ %)?(?:[;,:] *)?(.*)$/s.exec(said) ?? [];
  return {
    text: verdict,
    tone: VERDICTS[verdict],
    figure,
    reason: rest && `${capital(rest)}.`,
  };
}

/** Names of the two actuators' standing errors, which are no parameters of the vehicle. */
const OFFSETS: Readonly<Record<string, { title: string; shown: string }>> = {
  net_buoyancy_offset_kg: { title: 'Net buoyancy', shown: 'g' },
  mass_position_offset_m: { title: 'Mass position', shown: 'mm' },
};

export function isOffset({ name }: IdentifiedParameter): boolean {
  return name in OFFSETS;
}

/** "Net buoyancy +1.20 ± 0.30 g": what an actuator's own sensor was found to be off by. */
export function offsetText({ name, title, after, std, unit }: IdentifiedParameter): string {
  const known = OFFSETS[name];
  const { factor, label } = screenUnit(unit, known?.shown);
  const value = after * factor;
  const spread = std === null ? ', not identifiable' : ` ± ${fixed(std * factor, 2)} ${label}`;
  const sign = value > 0.005 ? '+' : '';
  const bare = std === null ? ` ${label}` : '';
  return `${known?.title ?? title} ${sign}${fixed(value, 2)}${bare}${spread}`;
}

/** What a search has reached, from its newest costs; empty before the first. */
export function searchText(message: string, curve: readonly CostPoint[]): string {
  const said = signed(message.trim());
  const best = curve.at(-1);
  if (!best || /cost/i.test(said)) return said;
  const reached = `move ${best.iteration}, best cost ${compact(best.cost)}`;
  return said ? `${said}, ${reached}` : reached;
}

/** `+-` as it is printed. */
export function signed(text: string): string {
  return text.replaceAll('+-', '±');
}

/** "0.21 to 0.24", or that the data set no bounds. */
export function intervalText({ low, high, verdict }: IdentifiedParameter): string {
  if (verdict === 'fixed') return '–';
  if (low === null || high === null) return 'unbounded';
  return `${compact(low)} to ${compact(high)}`;
}

/** Four digits of a parameter without zeros that say nothing. */
export function numberText(value: number | null): string {
  return value === null ? '–' : plainNumber(value, 4).replace('-', '\u2212');
}

/** Change in per cent of what it was; empty where that says nothing. */
export function changeText({ before, after }: IdentifiedParameter): string {
  if (before === 0 || before === after) return '';
  // Of a coefficient below 0 its size is what grows or shrinks.
  const percent = (after / before - 1) * 100;
  const size = Math.abs(percent);
  const digits = size < 10 ? 1 : 0;
  if (Number(size.toFixed(digits)) === 0) return '';
  return `${percent < 0 ? '\u2212' : '+'}${size.toFixed(digits)} %`;
}

/** How many of the searched parameters the data settle, in words. */
export function verdictSummary(parameters: readonly IdentifiedParameter[]): string {
  const count = (verdict: string) => parameters.filter((each) => each.verdict === verdict).length;
  const parts = [
    [count('identified'), 'identified'],
    [count('weak'), 'weak'],
    [count('not identifiable'), 'not identifiable from these data'],
  ].filter(([number]) => number !== 0);
  if (parts.length === 0) return 'No parameter was searched.';
  return `${parts.map(([number, text]) => `${number ?? 0} ${text ?? ''}`).join(', ')}.`;
}

/** One sentence for a stretch of the recording that was not used. */
export function leftOutText(
  { start_s, end_s, message, kind }: Omit<LeftOut, 'kind'> & { kind: string },
  from: string,
): string {
  const span = end_s > start_s ? ` for ${duration(end_s - start_s)}` : '';
  const said = message.trim() || kind.replaceAll('_', ' ');
  const at = clockTime(Date.parse(from) + start_s * 1000);
  return `${at}${span}: ${said.replace(/\.$/, '')}.`;
}

const STATES: Record<RunState, VerdictWord> = {
  running: { text: 'Running', tone: 'accent' },
  done: { text: 'Done', tone: 'ok' },
  failed: { text: 'Failed', tone: 'alarm' },
  cancelled: { text: 'Cancelled', tone: 'plain' },
  interrupted: { text: 'Interrupted', tone: 'watch' },
};

export function runWord(state: RunState): VerdictWord {
  return (
    (STATES as Partial<Record<string, VerdictWord>>)[state] ?? {
      text: capital(state),
      tone: 'plain',
    }
  );
}

export function isUnderWay(state: RunState | undefined): boolean {
  return state === 'running';
}
