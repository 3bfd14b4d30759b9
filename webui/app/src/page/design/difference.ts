/** How two designs, or a design and a plan, differ, in the station's words. */
import type { DifferenceView } from '../../api/generated/station';
import type { Leg } from '../../api/types';
import type { OutlineLeg } from './account.svelte';
import type { DesignView } from './document';

type VersionListing = DesignView['versions'][number];

export type Difference = DifferenceView;
export type LegChange = DifferenceView['legs'][number];

export interface Side {
  key: string;
  title: string;
}

/** What a design can be compared with. */
export function sidesOf(
  versions: readonly Pick<VersionListing, 'number' | 'comment' | 'plan'>[],
  plan: string | null,
): Side[] {
  const saved = versions.map(({ number, comment }) => ({
    key: `version:${number}`,
    title: comment ? `Version ${number}: ${comment}` : `Version ${number}`,
  }));
  const plans = [...new Set([plan, ...versions.map((one) => one.plan)])].filter(
    (one): one is string => one !== null,
  );
  return [
    { key: 'working', title: 'As it is now' },
    ...saved,
    { key: 'on_board', title: 'What is on board' },
    ...plans.map((id) => ({ key: `plan:${id}`, title: id.replace('-', ' ') })),
  ];
}

/** Legs of an outline for a map: straight, but for what only a plan says of a spiral. */
export function drawnLegs(legs: readonly OutlineLeg[]): Leg[] {
  return legs.map(({ kind, start_ned, end_ned, duration_s, energy }) => ({
    kind,
    start_ned,
    end_ned,
    duration_s,
    energy,
    speed_m_s: 0,
    heading_rad: 0,
    radius_m: 0,
    turn_rad: 0,
  }));
}

export const CHANGES: Record<LegChange['change'], { title: string; tone: string }> = {
  same: { title: 'same', tone: '' },
  moved: { title: 'moved', tone: 'tone-watch' },
  changed: { title: 'changed', tone: 'tone-watch' },
  added: { title: 'added', tone: 'tone-ok' },
  removed: { title: 'removed', tone: 'tone-alarm' },
};

/** "3 moved, 1 added"; empty where nothing differs. */
export function summary({ legs, fields }: Pick<Difference, 'legs' | 'fields'>): string {
  const kinds = ['moved', 'changed', 'added', 'removed'] as const;
  const counts = kinds
    .map((kind) => ({ kind, count: legs.filter(({ change }) => change === kind).length }))
    .filter(({ count }) => count > 0)
    .map(({ kind, count }) => `${count} ${count === 1 ? 'leg' : 'legs'} ${kind}`);
  if (fields.length > 0) {
    counts.push(`${fields.length} ${fields.length === 1 ? 'setting' : 'settings'} changed`);
  }
  return counts.join(', ');
}
