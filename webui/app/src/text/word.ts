import type { AlarmLevel, Health, PlanState, PrimitiveKind } from '../api/types';

/** Tone of a state: which of the few colours may be used for it. */
export type Tone = 'plain' | 'ok' | 'watch' | 'alarm' | 'accent';

/** How a level looks: an icon of its own shape, a word, and a colour that repeats them. */
export const LEVEL_MARKS = {
  normal: { icon: 'check', tone: 'plain', text: 'Normal' },
  info: { icon: 'info', tone: 'plain', text: 'Info' },
  watch: { icon: 'watch', tone: 'watch', text: 'Watch' },
  warning: { icon: 'warning', tone: 'watch', text: 'Warning' },
  severe: { icon: 'severe', tone: 'alarm', text: 'Severe' },
  critical: { icon: 'critical', tone: 'alarm', text: 'Critical' },
} as const satisfies Record<AlarmLevel, { icon: string; tone: Tone; text: string }>;

/** The least grave first. */
export const LEVELS = Object.keys(LEVEL_MARKS) as readonly AlarmLevel[];

export function rank(level: AlarmLevel): number {
  return LEVELS.indexOf(level);
}

/** Whether a level asks for a person at once. */
export function isGrave(level: AlarmLevel): boolean {
  return rank(level) >= rank('severe');
}

interface Word {
  text: string;
  tone: Tone;
  help: string;
}

const LINKS: Record<string, Word> = {
  never_heard: {
    text: 'Never heard',
    tone: 'watch',
    help: 'No packet of this robot has reached the station yet.',
  },
  live: { text: 'Live', tone: 'ok', help: 'Packets are arriving.' },
  stale: {
    text: 'Silent',
    tone: 'alarm',
    help: 'No packet for longer than this link allows, and the robot did not say that it would dive.',
  },
  submerged: {
    text: 'Under water',
    tone: 'plain',
    help: 'Silent because it said that it would dive. Radio does not reach it there.',
  },
  mute: {
    text: 'Radio mute',
    tone: 'alarm',
    help: 'The port is open, but the station’s own radio does not answer.',
  },
  port_closed: {
    text: 'Port closed',
    tone: 'alarm',
    help: 'The station cannot open the port of this link. It keeps trying.',
  },
  unplugged: {
    text: 'Unplugged',
    tone: 'watch',
    help: 'A person pulled the plug: the station does not use this link.',
  },
};

/** Heard now and then: between two sessions nobody hears the robot. */
const CALLS: Word = {
  text: 'Calls regularly',
  tone: 'plain',
  help: 'Its last session by satellite was in time. Between two sessions nobody hears it.',
};

export function linkWord(state: string, carrier = ''): Word {
  if (state === 'live' && isSatellite(carrier)) return CALLS;
  return LINKS[state] ?? { text: words(state), tone: 'plain', help: '' };
}

const CARRIERS: Record<string, string> = {
  xbee: 'XBee',
  iridium: 'Iridium',
  rockblock: 'RockBLOCK',
  directip: 'Iridium DirectIP',
  cloudloop: 'Cloudloop',
  serial: 'serial line',
  udp: 'UDP',
  tcp: 'TCP',
  micromodem: 'acoustic modem',
  cameras: 'cameras',
  acoustic: 'acoustic',
  simulator: 'simulator',
};

const SATELLITES: readonly string[] = ['iridium', 'rockblock', 'directip', 'cloudloop'];

export function isSatellite(carrier: string): boolean {
  return SATELLITES.includes(carrier);
}

export function carrierName(carrier: string): string {
  return CARRIERS[carrier] ?? carrier;
}

const PLANS: Record<PlanState, Word> = {
  planning: { text: 'Planning', tone: 'accent', help: 'The planner is searching.' },
  draft: { text: 'Draft', tone: 'plain', help: 'Only the station has this plan.' },
  sent: {
    text: 'Sent',
    tone: 'watch',
    help: 'On its way. The robot has not confirmed it and may still fly its former plan.',
  },
  waiting: {
    text: 'Waiting on board',
    tone: 'watch',
    help: 'The robot keeps the plan behind the one that it flies, until the next surfacing.',
  },
  on_board: {
    text: 'On board',
    tone: 'ok',
    help: 'The robot answered with the plan’s own fingerprint (SHA-256).',
  },
  running: { text: 'Running', tone: 'ok', help: 'The robot says that it is flying this plan.' },
  done: { text: 'Done', tone: 'plain', help: 'The robot says that it flew the last leg.' },
  failed: { text: 'Failed', tone: 'alarm', help: 'The plan ended before its last leg.' },
  superseded: { text: 'Replaced', tone: 'plain', help: 'A newer plan took its place.' },
  cancelled: {
    text: 'Cancelled',
    tone: 'plain',
    help: 'A person ended it: its planning, the draft, or by a surface order its flight.',
  },
};

export function planWord(state: PlanState): Word {
  return PLANS[state];
}

const MISSIONS: Record<string, Word> = {
  planning: { text: 'Planning the first round', tone: 'accent', help: '' },
  ready: { text: 'Ready, waiting for you', tone: 'accent', help: 'A draft is ready to be sent.' },
  running: { text: 'Robot is flying a round', tone: 'ok', help: '' },
  replanning: { text: 'Planning the next round', tone: 'accent', help: '' },
  scoring: { text: 'Scoring the map', tone: 'accent', help: '' },
  done: { text: 'Done', tone: 'ok', help: 'The energy budget is spent.' },
  failed: { text: 'Failed', tone: 'alarm', help: '' },
  stopped: { text: 'Stopped', tone: 'watch', help: 'No further round starts by itself.' },
};

const ROUNDS: Partial<Record<PlanState, Word>> = {
  draft: {
    text: 'Its round is to be sent',
    tone: 'watch',
    help: 'The robot does not have it yet.',
  },
  sent: { text: 'Its round is on its way', tone: 'watch', help: 'The robot has not confirmed it.' },
  on_board: { text: 'Its round is on board', tone: 'accent', help: 'The robot has not begun it.' },
};

/** A mission goes on from the moment that its plan is ordered, long before a robot flies it. */
export function missionWord(state: string, round: PlanState | null = null): Word {
  if (state === 'running' && round !== null && ROUNDS[round]) return ROUNDS[round];
  return MISSIONS[state] ?? { text: words(state), tone: 'plain', help: '' };
}

export const PRIMITIVES: Record<PrimitiveKind, { title: string; help: string }> = {
  glide: { title: 'Glide', help: 'Straight, sinking or rising on its wings, tail still.' },
  spiral: { title: 'Spiral', help: 'Sinking or rising on a circle, tail held to one side.' },
  dive: { title: 'Dive', help: 'Straight down or up by buoyancy alone.' },
  swim: { title: 'Swim', help: 'Along the surface, beating its tail.' },
  keep: {
    title: 'Keep',
    help: 'Stays at the surface near a place, and swims back when it drifted beyond its radius.',
  },
};

/** `not_a_word` as a person writes it. */
export function words(key: string): string {
  const spaced = key
    .replaceAll(/_+|\.(?=\D)/g, ' ')
    .replaceAll(/\bmpc\b/g, 'MPC')
    .trim();
  return spaced.charAt(0).toUpperCase() + spaced.slice(1);
}

/** `1 credit`, `10 credits` */
export function creditText(credits: number): string {
  return `${credits} ${credits === 1 ? 'credit' : 'credits'}`;
}

/** Plan 14 of `plan-14`. */
export function planName(id: string | null): string {
  if (id === null) return 'plan';
  const number = /^plan-(\d+)$/.exec(id)?.[1];
  return number === undefined ? id : `plan ${number}`;
}

/** A sentence of the station with its plans and missions named as the app names them. */
export function readable(text: string): string {
  return text
    .replace(/(?<![\w/-])(plan|mission)-(\d+)\b/gi, '$1 $2')
    .replace(/(^|[.!?] )(plan|mission)(?= \d)/g, (_, before: string, word: string) => {
      return before + capital(word);
    });
}

export function missionName(id: string): string {
  const number = /^mission-(\d+)$/.exec(id)?.[1];
  return number === undefined ? id : `mission ${number}`;
}

/** The station's own word on how an alarm ended; an age goes on with it. */
const TELLS_ITS_END = /; (found again|its pursuit ended)$/;

/** What an alarm that is over says, in one short line. */
export function overText(text: string, ago: string): string {
  const told = text.replace(/\.$/, '');
  return TELLS_ITS_END.test(told) ? `${told} ${ago}` : `${told}; back to normal ${ago}`;
}

/** A title inside a sentence; one that begins with an acronym stays as it is. */
export function lower(title: string): string {
  return /^[A-Z][A-Z]/.test(title) ? title : title.charAt(0).toLowerCase() + title.slice(1);
}

/** What a robot does; of an old report how old it is, as its link may be live without a newer. */
export function datedActivity(activity: string, ago: string): string {
  const old = /^Last heard: (.+)$/.exec(activity)?.[1];
  return old === undefined ? activity : `${capital(old)}, as it said ${ago || 'long ago'}`;
}

/** What a robot did when the station was heard last. */
export function lastKnown(activity: string): string {
  return activity.startsWith('Last heard') ? activity : `Last known: ${lower(activity)}`;
}

export function capital(text: string): string {
  return text.charAt(0).toUpperCase() + text.slice(1);
}

export function healthSentence(health: Pick<Health, 'storage' | 'reasons'>): string | null {
  if (!health.storage.ok) {
    return `Storage fault: ${health.storage.message} No plan is accepted until it is cured.`;
  }
  if (health.storage.message) return health.storage.message;
  return health.reasons.length ? `Station fault: ${health.reasons.join(' ')}` : null;
}
