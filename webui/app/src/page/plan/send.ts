import type { LinkKind, Plan, RobotLink, RouteChoice, SatelliteQuote, Way } from '../../api/types';
import { shownState } from '../../part/link_state';
import { carrierName } from '../../text/word';

/** When a plan is sent. */
export type When = 'now' | 'surfacing' | 'time' | 'value' | 'after';

/** When it is sent and when it starts, for whoever is about to send it; `name` is of the plan. */
export function startText(
  {
    robot,
    plan,
    aboard,
    isFlying,
  }: Record<'robot' | 'plan', string> & {
    /** Plan that the robot has. */
    aboard: string | null;
    isFlying: boolean;
  },
  when: When,
): string {
  const kept = `${robot} keeps ${aboard ?? 'what it has'} until it has the whole of ${plan} and answers with its fingerprint.`;
  if (when !== 'now') {
    return `Once it is sent, ${kept} Then ${plan} starts: at once if ${robot} is idle, else at its next surfacing.`;
  }
  return isFlying
    ? `${kept} Then ${plan} waits on board and starts at the next surfacing, between two dives.`
    : `${kept} Then ${robot} starts ${plan} by itself, without another order.`;
}

/** Limits that keep a robot in safe water. */
const OUT_OF_BOUNDS = ['domain', 'keep_outs'];

/**
 * What speaks against sending a draft, which a person may know better; the station refuses it for
 * these until that is confirmed.
 */
export function reservations(plan: Pick<Plan, 'state' | 'outdated' | 'rehearsal'>): string[] {
  if (plan.state !== 'draft') return [];
  const { rehearsal } = plan;
  const beyond = (rehearsal?.broken ?? []).filter(({ field }) => OUT_OF_BOUNDS.includes(field));
  const isFlawed = rehearsal?.completed === false || (rehearsal?.entered ?? []).length > 0;
  return [
    ...plan.outdated.map(({ message }) => message),
    ...beyond.map(({ message }) => `Its rehearsal says: ${message}`),
    ...(rehearsal && isFlawed ? [`Its rehearsal says: ${rehearsal.message}`] : []),
  ];
}

/** What "automatic" takes: the station's word, else what its links tell. */
export function wayOf(
  choice: RouteChoice,
  links: readonly RobotLink[],
  quote: SatelliteQuote | null,
): Way {
  if (choice !== 'auto') {
    return {
      route: choice,
      reason: choice === 'radio' ? chosenRadio(links) : 'By satellite, as you chose.',
    };
  }
  return quote?.auto ?? guessedWay(links);
}

/** A plan for a robot out of reach goes nowhere: said before it is sent. */
function chosenRadio(links: readonly RobotLink[]): string {
  const radios = links.filter(({ kind }) => kind === 'radio');
  const isLive = radios.some((link) => link.is_plugged && shownState(link) === 'live');
  return isLive || radios.length === 0
    ? 'By radio, as you chose.'
    : 'By radio, as you chose: no radio hears the robot now, so the plan waits until one does.';
}

function guessedWay(links: readonly RobotLink[]): Way {
  const isUsable = (kind: LinkKind) => (link: RobotLink) => link.kind === kind && link.is_plugged;
  const radios = links.filter(isUsable('radio'));
  const live = radios.find((link) => shownState(link) === 'live');
  if (live) return { route: 'radio', reason: `By radio: ${carrierName(live.carrier)} is live and costs nothing.` };
  if (links.some(isUsable('satellite'))) {
    return { route: 'satellite', reason: 'By satellite: no radio hears the robot now.' };
  }
  return { route: 'radio', reason: 'By radio: the plan waits until the robot is heard.' };
} // prettier-ignore

/** `1.30 GBP`; a tariff without a price is told as such. */
export function priceText(price: number, currency: string): string {
  return currency === '' ? 'no price set' : `${price.toFixed(2)} ${currency}`;
}

/** `270 + 136 B`: what each message carries. */
export function sizesText(messages: readonly { bytes: number }[]): string {
  return `${messages.map(({ bytes }) => bytes).join(' + ')} B`;
}
