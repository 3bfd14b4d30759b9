/**
 * Addresses of the pages: `/page` or `/page/robot`, and `#section` within; the fleet is `/`. A page
 * that is `within` another is reached from there, and shown as part of it in the rail. `manual` is the
 * section of the manual that is about it.
 */

export const PAGES = [
  { key: 'fleet', title: 'Fleet', letter: 'f', hasRobot: false, manual: 'fleet' },
  { key: 'robot', title: 'Robot', letter: 'r', hasRobot: true, manual: 'robot' },
  { key: 'drive', title: 'Drive', letter: 'v', hasRobot: true, within: 'robot', manual: 'driving' },
  { key: 'design', title: 'Design', letter: 'e', hasRobot: true, manual: 'designs' },
  { key: 'plan', title: 'Plan', letter: 'p', hasRobot: true, manual: 'surveys' },
  { key: 'track', title: 'Track', letter: 't', hasRobot: true, manual: 'targets' },
  { key: 'map', title: 'Map', letter: 'm', hasRobot: true, manual: 'maps' },
  {
    key: 'control',
    title: 'Control',
    letter: 'c',
    hasRobot: true,
    manual: 'settings#how-robots-plan-and-steer',
  },
  { key: 'data', title: 'Data', letter: 'd', hasRobot: true, manual: 'data' },
  { key: 'log', title: 'Log', letter: 'l', hasRobot: false, manual: 'log-book' },
  { key: 'settings', title: 'Settings', letter: 's', hasRobot: false, manual: 'settings' },
  {
    key: 'camera',
    title: 'Cameras',
    letter: 'a',
    hasRobot: false,
    within: 'settings',
    manual: 'cameras',
  },
  {
    key: 'storage',
    title: 'Storage',
    letter: 'o',
    hasRobot: false,
    within: 'settings',
    manual: 'storage',
  },
] as const;

export type PageKey = (typeof PAGES)[number]['key'];

export interface Route {
  page: PageKey;
  robot: string | null;
  /** Part of the page that is open; "" for the first. */
  section: string;
  /** Moment that the page is opened at, RFC 3339; `null` for now. */
  at: string | null;
}

export function parseRoute(path: string, hash = '', search = ''): Route {
  const [first = '', second] = path.split('/').filter(Boolean);
  const page = PAGES.find(({ key }) => key === first) ?? PAGES[0];
  const robot = page.hasRobot && second ? decode(second) : null;
  const at = momentOf(search);
  return { page: page.key, robot, section: decode(hash.replace(/^#/, '')) ?? '', at };
}

/** Pages that the rail names. */
export const RAIL = PAGES.filter((page) => !('within' in page));

/** The page of the rail that a page belongs to. */
export function railPage(key: PageKey): PageKey {
  const page = PAGES.find((one) => one.key === key);
  return page && 'within' in page ? page.within : key;
}

export function routePath(page: PageKey, robot: string | null, section = ''): string {
  if (page === 'fleet') return '/';
  const hasRobot = PAGES.find(({ key }) => key === page)?.hasRobot ?? false;
  const path = hasRobot && robot !== null ? `/${page}/${encodeURIComponent(robot)}` : `/${page}`;
  return section ? `${path}#${encodeURIComponent(section)}` : path;
}

/** The moment of `?at=`, in the station's notation; `null` for none, or for what is no moment. */
function momentOf(search: string): string | null {
  const ms = Date.parse(new URLSearchParams(search).get('at') ?? '');
  return Number.isNaN(ms) ? null : new Date(ms).toISOString();
}

function decode(part: string): string | null {
  try {
    return decodeURIComponent(part);
  } catch {
    return null;
  }
}

/** Section of the manual that a page belongs to; its contents where it names none. */
export function pageManual(key: PageKey): string {
  const page = PAGES.find((one) => one.key === key);
  return page && 'manual' in page ? page.manual : '';
}

/** Page that a plan of a kind is made and followed on. */
export function pageOf(planKind: string): PageKey {
  return planKind === 'track_target' ? 'track' : 'plan';
}
