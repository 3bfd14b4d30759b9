import type { Role } from '../../api/types';

export const ROLES: readonly { key: Role; title: string }[] = [
  { key: 'none', title: 'Chosen robots only' },
  { key: 'viewer', title: 'Viewer' },
  { key: 'pilot', title: 'Pilot' },
  { key: 'admin', title: 'Administrator' },
];
