import type { Role, Session } from '../api/types';

const ORDER: readonly Role[] = ['none', 'viewer', 'pilot', 'admin'];

/** The role of who is signed in for a robot, the highest that holds; for the station without one. */
export function roleFor(session: Session | null | undefined, robot: string | null): Role {
  const forAll = session?.role ?? 'none';
  const granted = robot === null ? 'none' : (session?.robots[robot] ?? 'none');
  return isAtLeast(forAll, granted) ? forAll : granted;
}

export function isAtLeast(role: Role, least: Role): boolean {
  return ORDER.indexOf(role) >= ORDER.indexOf(least);
}

/** Whether somebody may pilot at least one robot. */
export function pilotsAny(session: Session | null | undefined): boolean {
  if (!session) return false;
  return [session.role, ...Object.values(session.robots)].some((role) => isAtLeast(role, 'pilot'));
}

/**
 * Why somebody may not pilot a robot, one sentence; empty where they may.
 *
 * @param name As the robot is called on the screen; `null` for the station as a whole.
 */
export function whyNotPilot(
  session: Session | null | undefined,
  robot: string | null,
  name: string | null,
): string {
  if (isAtLeast(roleFor(session, robot), 'pilot')) return '';
  if (!pilotsAny(session)) return 'This needs the role of a pilot.';
  if (name === null) return 'You pilot chosen robots; this is of the whole station.';
  return `You may look at ${name}; this needs a pilot of it.`;
}
