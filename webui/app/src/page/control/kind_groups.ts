import type { ConfigKind } from '../../api/types';
import { words } from '../../text/word';

/** What each kind of settings decides. */
const HELP: Record<string, string> = {
  planner: 'Where to go: domain, budgets, objective and limits of a survey.',
  field: 'How measurements become a map: kernels, noise and grid.',
  estimator: 'How the robot’s position and motion are estimated from its sensors.',
  trim: 'Standing offsets of buoyancy and mass position, which travel with every plan.',
  battery: 'How much the robot’s battery holds, which tells whether a mission lasts.',
  tracking: 'How a target is followed by its range; the page Track has the same form.',
  trial: 'The scenario that a what-if run begins with.',
  identification: 'How parameters of the vehicle are searched for in recordings.',
  'controller.backstepping': 'Steers along a glide: the proposed controller.',
  'controller.baseline': 'The proposed controller without pitch for horizontal error.',
  'controller.pid': 'Three plain loops, one for each actuator.',
  'controller.integral': 'The proposed controller that also learns what stays wrong.',
  'controller.governor':
    'Backstepping that learns offsets and foresees a slow, late mass actuator.',
  'controller.swimming': 'Beats the tail to swim.',
  satellite:
    'Tariff and daily budget of satellite messages, how long they stand, and how often the robot calls.',
  acoustic: 'Speed of sound and how often and how far the acoustic modem measures ranges.',
  link: 'Which link plans and orders take.',
  automation: 'What the station suggests and sends by itself, and how much of that in an hour.',
  checklist: 'Whether a start waits for the robot’s checklists.',
  standard_commands:
    'What a MAVLink vehicle is told for “surface”, “hold” and “resume”; its maker says the numbers.',
};

interface Group {
  title: string;
  has: (kind: string) => boolean;
}

const GROUPS: readonly Group[] = [
  {
    title: 'Survey',
    has: (kind) => ['planner', 'field', 'estimator', 'automation', 'checklist'].includes(kind),
  },
  { title: 'Following a target', has: (kind) => kind === 'tracking' },
  { title: 'Controllers', has: (kind) => kind.startsWith('controller.') },
  {
    title: 'Links',
    has: (kind) => ['satellite', 'link', 'acoustic', 'standard_commands'].includes(kind),
  },
  {
    title: 'Vehicle',
    has: (kind) => ['battery', 'trim', 'identification', 'trial'].includes(kind),
  },
];

export interface KindGroup {
  title: string;
  kinds: { kind: string; title: string; help: string }[];
}

/** Kinds of settings by what they are about; one that no group knows comes last. */
export function kindGroups(kinds: readonly ConfigKind[]): KindGroup[] {
  const named = kinds.map(({ kind, title }) => ({
    kind,
    title: title || words(kind.replace(/^controller\./, '')),
    help: HELP[kind] ?? '',
  }));
  const groups = GROUPS.map(({ title, has }) => ({
    title,
    kinds: named.filter(({ kind }) => has(kind)),
  }));
  const others = named.filter(({ kind }) => !GROUPS.some(({ has }) => has(kind)));
  return [...groups, { title: 'Other', kinds: others }].filter(({ kinds: own }) => own.length > 0);
}

/** Kinds that a robot can be given; one of no robot in particular is every robot's. */
export function kindsOf(kinds: readonly ConfigKind[], robot: string): ConfigKind[] {
  return kinds.filter(({ robots }) => robots.length === 0 || robots.includes(robot));
}

export function isController({ kind }: ConfigKind): boolean {
  return kind.startsWith('controller.');
}
