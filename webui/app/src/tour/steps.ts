import type { PageKey } from '../page/route';

/** One thing that a new person is shown. */
export interface TourStep {
  page: PageKey;
  /** Its `data-tour` mark; where a page has none, the words stand alone. */
  anchor: string;
  title: string;
  text: string;
  /** Section of the manual that tells more. */
  manual: string;
}

export const STEPS: readonly TourStep[] = [
  {
    page: 'fleet',
    anchor: 'facts',
    title: 'Fleet: is everyone all right?',
    text: 'One card a robot: which link heard it and when, when it should be heard next, the plan that it confirmed, its worst alarm. Old values turn grey and say how old they are.',
    manual: 'fleet',
  },
  {
    page: 'robot',
    anchor: 'gauges',
    title: 'Robot: what does it do, and where is it?',
    text: 'Depth, heading, battery, and how well it knows its place: ± is a standard deviation in metres. It grows under water and ends with a fix at the surface. Dashed things are predicted.',
    manual: 'robot',
  },
  {
    page: 'robot',
    anchor: 'surface',
    title: 'Surface now: bring it up',
    text: 'The same place on every page. Read the name, and the sentence that says when the order reaches it. Then hold the button for a second, by pointer, Enter or Space.',
    manual: 'surface-now',
  },
  {
    page: 'plan',
    anchor: 'plan',
    title: 'Plan: make one, then send it',
    text: 'Fill in the form and plan: nothing is sent. “Send” opens a summary first. The ladder says what is proved: a plan is on board only after the robot answered with its fingerprint.',
    manual: 'sending',
  },
  {
    page: 'log',
    anchor: 'log',
    title: 'Log: what happened, and who did it?',
    text: 'The log book, events, alarms, commands, satellite messages. The bell above counts alarms that nobody has acknowledged. Press ? for all keys; the manual is in the person menu.',
    manual: 'log-book',
  },
];

export interface Box {
  left: number;
  top: number;
  width: number;
  height: number;
}

interface Size {
  width: number;
  height: number;
}

const GAP_PX = 14;
const EDGE_PX = 8;

/**
 * Place a card beside what it explains, inside of the window: below, above, right or left of it, at
 * the first side that has the room; else where it covers least.
 */
export function cardPlace(
  anchor: Box | null,
  card: Size,
  view: Size,
): { left: number; top: number } {
  const clamp = (at: number, size: number, room: number) =>
    Math.max(EDGE_PX, Math.min(at, room - size - EDGE_PX));
  const inside = (left: number, top: number) => ({
    left: clamp(left, card.width, view.width),
    top: clamp(top, card.height, view.height),
  });
  if (anchor === null) {
    return inside((view.width - card.width) / 2, view.height - card.height - 72);
  }
  const right = anchor.left + anchor.width;
  const bottom = anchor.top + anchor.height;
  const spots = [
    inside(anchor.left, bottom + GAP_PX),
    inside(anchor.left, anchor.top - GAP_PX - card.height),
    inside(right + GAP_PX, anchor.top),
    inside(anchor.left - GAP_PX - card.width, anchor.top),
  ];
  const [first] = spots.sort((a, b) => covered(a, card, anchor) - covered(b, card, anchor));
  return first ?? inside(0, 0);
}

/** How much of what it explains a card would cover, pixels of area. */
function covered(at: { left: number; top: number }, card: Size, anchor: Box): number {
  const width =
    Math.min(at.left + card.width, anchor.left + anchor.width) - Math.max(at.left, anchor.left);
  const height =
    Math.min(at.top + card.height, anchor.top + anchor.height) - Math.max(at.top, anchor.top);
  return Math.max(0, width) * Math.max(0, height);
}
