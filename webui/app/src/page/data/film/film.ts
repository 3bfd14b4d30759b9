import type { Film, FilmWish } from '../../../api/replay';
import type { DiveFacts } from '../../../api/types';
import { clockTime } from '../../../text/time';

/** What a film can be, as the page names it. */
export const KINDS = [
  { key: 'page', title: '3D page' },
  { key: 'pictures', title: 'Pictures' },
  { key: 'viser', title: 'viser file' },
] as const satisfies readonly { key: Film['kind']; title: string }[];

export const WHAT: Readonly<Record<Film['kind'], string>> = {
  page: 'One page of HTML with the 3D view: it plays in any browser, without a station.',
  pictures: 'Numbered PNG in a ZIP, ten a second: the way from above and the depth.',
  viser: "The 3D view for viser's own player.",
};

/** Lengths of a film, s. */
export const LENGTHS = [10, 30, 60, 120] as const;

const AROUND_MS = 5 * 60_000;
/** A film cannot be of less. */
const LEAST_MS = 1000;

/** A part of the past that can become a film. */
export interface Stretch {
  key: string;
  title: string;
  /** Ms since 1970. */
  range: readonly [number, number];
}

/** What can become a film: the loop, some minutes, each dive, all of it; the first fits best. */
export function stretchesOf(
  at: number,
  bounds: readonly [number, number],
  loop: readonly [number, number] | null,
  dives: readonly DiveFacts[],
): Stretch[] {
  const cut = ([from, to]: readonly [number, number]): readonly [number, number] => [
    Math.max(from, bounds[0]),
    Math.min(to, bounds[1]),
  ];
  const ofDives = dives.map((dive) => {
    const range = [Date.parse(dive.begin_at), Date.parse(dive.end_at)] as const;
    const title = `Dive ${String(dive.number)}, ${clockTime(range[0])}, ${dive.depth_m.toFixed(1)} m`;
    return { key: `dive ${String(dive.number)}`, title, range: cut(range) };
  });
  const isHere = ({ range }: Stretch): boolean => range[0] <= at && at <= range[1];
  const all: Stretch[] = [
    ...(loop ? [{ key: 'loop', title: 'The loop', range: cut(loop) }] : []),
    ...ofDives.filter(isHere),
    {
      key: 'around',
      title: '5 min before and after the cursor',
      range: cut([at - AROUND_MS, at + AROUND_MS]),
    },
    ...ofDives.filter((each) => !isHere(each)),
    { key: 'all', title: 'All of it', range: bounds },
  ];
  return all.filter(({ range: [from, to] }) => to - from >= LEAST_MS);
}

/** How much faster than life a film runs, in words. */
export function pace([from, to]: readonly [number, number], lastsS: number): string {
  const speed = (to - from) / 1000 / lastsS;
  return `${speed < 10 ? speed.toFixed(1) : speed.toFixed(0)} times as fast as life`;
}

export type Kind = NonNullable<FilmWish['kind']>;

/** Where a film is fetched from. */
export function filmPath(robot: string, film: string): string {
  return `/api/robots/${encodeURIComponent(robot)}/films/${encodeURIComponent(film)}`;
}
