/**
 * Addresses of the pages: `/page` or `/page/robot`, and `#section` within; the fleet is `/`. A page
 * that is `within` another is reached from there, and shown as part of it in the rail.
 */

export const PAGES = [
  { key: 'fleet', title: 'Fleet', letter: 'f', hasRobot: false },
  { key: 'robot', title: 'Robot', letter: 'r', hasRobot: true },
  { key: 'drive', title: 'Drive', letter: 'v', hasRobot: true, within: 'robot' },
  { key: 'design', title: 'Design', letter: 'e', hasRobot: true },
  { key: 'plan', title: 'Plan', letter: 'p', hasRobot: true },
  { key: 'track', title: 'Track', letter: 't', hasRobot: true },
  { key: 'map', title: 'Map', letter: 'm', hasRobot: true },
  { key: 'control', title: 'Control', letter: 'c', hasRobot: true },
  { key: 'data', title: 'Data', letter: 'd', hasRobot: true },
  { key: 'log', title: 'Log', letter: 'l', hasRobot: false },
  { key: 'settings', title: 'Settings', letter: 's', hasRobot: false },
] as const;

export type PageKey = (typeof PAGES)[number]['key'];

export interface Route {
  page: PageKey;
  robot: string | null;
  /** Part of the page that is open; "" for the first. */
  section: string;
}

export function parseRoute(path: string, hash = ''): Route {
  const [first = '', second] = path.split('/').filter(Boolean);
  const page = PAGES.find(({ key }) => key === first) ?? PAGES[0];
  const robot = page.hasRobot && second ? decode(second) : null;
  return { page: page.key, robot, section: decode(hash.replace(/^#/, '')) ?? '' };
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

function decode(part: string): string | null {
  try {
    return decodeURIComponent(part);
  } catch {
    return null;
  }
}

/** Page that a plan of a kind is made and followed on. */
export function pageOf(planKind: string): PageKey {
  return planKind === 'track_target' ? 'track' : 'plan';
}
