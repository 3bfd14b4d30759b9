import type { Role } from '../../api/types';

export const ROLES: readonly { key: Role; title: string }[] = [
  { key: 'viewer', title: 'Viewer' },
  { key: 'pilot', title: 'Pilot' },
  { key: 'admin', title: 'Administrator' },
];
