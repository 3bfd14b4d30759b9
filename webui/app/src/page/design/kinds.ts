/** What can be drawn, in the words of the list of new designs, and how each of them begins. */
import type { Box } from '../../api/types';
import { PLAIN_MANNER, PLAIN_SURFACING, type Content, type Design, type Spot } from './document';

export interface DesignKind {
  key: string;
  title: string;
  help: string;
  /** How it begins over a box of a size. */
  begin: (box: BoxShape) => Content;
}

/** A box by its middle and half its lengths, m. */
export interface BoxShape {
  north: number;
  east: number;
  tall: number;
  wide: number;
}

/** Part of the water's box that something new fills. */
const SHARE = 0.5;

const spot = (north: number, east: number): Spot => ({ north_m: cm(north), east_m: cm(east) });
const middle = ({ north, east }: BoxShape) => spot(north, east);
const reach = ({ tall, wide }: BoxShape) => cm(Math.min(tall, wide));

function corners({ north, east, tall, wide }: BoxShape): Spot[] {
  return [
    spot(north - tall, east - wide),
    spot(north + tall, east - wide),
    spot(north + tall, east + wide),
    spot(north - tall, east + wide),
  ];
}

function line({ north, east, tall, wide }: BoxShape): Spot[] {
  return wide >= tall
    ? [spot(north, east - wide), spot(north, east + wide)]
    : [spot(north - tall, east), spot(north + tall, east)];
}

export const KINDS: readonly DesignKind[] = [
  {
    key: 'waypoints',
    title: 'Waypoints',
    help: 'Places one after the other, each with its own way of getting there.',
    begin: () => ({ kind: 'waypoints', waypoints: [], returns: false }),
  },
  {
    key: 'lawnmower',
    title: 'Lawnmower',
    help: 'Parallel lines over an area, to and fro.',
    begin: (box) => lawnmower(box, false),
  },
  {
    key: 'cross_hatch',
    title: 'Cross-hatch',
    help: 'A lawnmower, and a second one across it: every place is seen from two sides.',
    begin: (box) => lawnmower(box, true),
  },
  {
    key: 'expanding_square',
    title: 'Expanding square',
    help: 'A square spiral outwards: the search for something lost near a place.',
    begin: (box) => ({
      kind: 'expanding_square',
      centre: middle(box),
      spacing_m: null,
      turns: 3,
      heading_rad: 0,
    }),
  },
  {
    key: 'spiral',
    title: 'Spiral',
    help: 'A round spiral outwards from a place.',
    begin: (box) => ({
      kind: 'spiral',
      centre: middle(box),
      spacing_m: null,
      radius_m: reach(box),
    }),
  },
  {
    key: 'star',
    title: 'Star',
    help: 'Lines through one place at evenly spread headings.',
    begin: (box) => ({
      kind: 'star',
      centre: middle(box),
      radius_m: reach(box),
      lines: 3,
      heading_rad: 0,
    }),
  },
  {
    key: 'along_line',
    title: 'Along a line',
    help: 'Along a shore, a pipe or a front, and back beside it.',
    begin: (box) => ({ kind: 'along_line', line: line(box), passes: 2, spacing_m: null }),
  },
  {
    key: 'along_isobath',
    title: 'Along an isobath',
    help: 'Along a line of equal depth of the floor.',
    begin: (box) => ({
      kind: 'along_isobath',
      depth_m: 1,
      near: middle(box),
      length_m: cm(2 * Math.max(box.tall, box.wide)),
      is_reversed: false,
    }),
  },
  {
    key: 'section',
    title: 'Section',
    help: 'One line flown again and again: how the water changes with time.',
    begin: (box) => ({ kind: 'section', line: line(box), repeats: 2 }),
  },
  {
    key: 'mooring',
    title: 'Virtual mooring',
    help: 'Profiles at one place for a while, spiralling down and up.',
    begin: (box) => ({ kind: 'mooring', place: middle(box), duration_s: 3600 }),
  },
  {
    key: 'station_keep',
    title: 'Station keeping',
    help: 'Stays near a place at the surface for a while, and swims back when it drifts off.',
    begin: (box) => ({
      kind: 'station_keep',
      place: middle(box),
      radius_m: cm(reach(box) / 10),
      duration_s: 1800,
    }),
  },
  {
    key: 'reference',
    title: 'Reference trajectory',
    help: 'A trajectory in time: the diagonal or the figure of eight of the thesis.',
    begin: (box) => ({
      kind: 'reference',
      shape: 'diagonal',
      origin: middle(box),
      duration_s: 225,
      rows: [],
    }),
  },
];

function lawnmower(box: BoxShape, is_crossed: boolean): Content {
  return { kind: 'lawnmower', area: corners(box), spacing_m: null, heading_rad: 0, is_crossed };
}

/** The middle of the part of a water that is explored. */
export function boxIn(domain: Box): BoxShape {
  return {
    north: (domain.x_min_m + domain.x_max_m) / 2,
    east: (domain.y_min_m + domain.y_max_m) / 2,
    tall: (SHARE * (domain.x_max_m - domain.x_min_m)) / 2,
    wide: (SHARE * (domain.y_max_m - domain.y_min_m)) / 2,
  };
}

/** How much more than the planner's margin a new design keeps above the floor. */
const CLEARANCE = 1.25;

/** A new design of a kind for a water whose floor plans keep a margin from, m. */
export function begun(kind: DesignKind, domain: Box, floorMarginM = 0): Design {
  const content = kind.begin(boxIn(domain));
  const depth_m = round(0.5 * domain.depth_max_m, 1);
  return {
    content: content.kind === 'along_isobath' ? { ...content, depth_m } : content,
    manner: {
      ...PLAIN_MANNER,
      floor_clearance_m: floorMarginM > 0 ? round(CLEARANCE * floorMarginM, 2) : null,
    },
    surfacing: PLAIN_SURFACING,
  };
}

/** What a content is called. */
export function titleOf(content: Content | { kind: string; is_crossed?: boolean }): string {
  const key =
    content.kind === 'lawnmower' && 'is_crossed' in content && content.is_crossed
      ? 'cross_hatch'
      : content.kind;
  return KINDS.find((one) => one.key === key)?.title ?? content.kind.replaceAll('_', ' ');
}

function cm(value: number): number {
  return round(value, 2);
}

function round(value: number, digits: number): number {
  return Math.round(value * 10 ** digits) / 10 ** digits;
}
