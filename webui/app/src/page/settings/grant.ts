import type { Grant, Role } from '../../api/types';
import { ROLES } from './role';

/** Roles that can be given for one robot or one group. */
export const GRANTED = ROLES.filter(({ key }) => key !== 'none');

/** A grant as the station takes it: of a robot or of a group, never of both. */
export type NewGrant =
  { robot: string; role: Exclude<Role, 'none'> } | { group: string; role: Exclude<Role, 'none'> };

/** What the station takes of grants that it told. */
export function asNew(grants: readonly Grant[]): NewGrant[] {
  return grants.map(({ role, robot, group }) => {
    const given = role as Exclude<Role, 'none'>;
    return robot === null ? { group: group ?? '', role: given } : { robot, role: given };
  });
}

/** Whom a grant is about, in words. */
export function subjectOf(grant: NewGrant): string {
  return 'robot' in grant ? grant.robot : `group ${grant.group}`;
}

/** What somebody is, in one line: the role for all robots, and those for chosen ones. */
export function rightsInWords(role: Role, grants: readonly NewGrant[]): string {
  const parts = grants.map((one) => `${titleOf(one.role)} of ${subjectOf(one)}`);
  if (role !== 'none') parts.unshift(`${titleOf(role)} of all robots`);
  return parts.join(', ') || 'Nothing';
}

function titleOf(role: Role): string {
  return ROLES.find(({ key }) => key === role)?.title ?? role;
}
