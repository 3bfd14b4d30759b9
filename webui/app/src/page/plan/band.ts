import type { FlightBand } from '../../api/types';

type Three = readonly [low: number, middle: number, high: number];

/** Low, median and high of something at a moment. */
export interface BandMoment {
  t: number;
  values: Three;
}

/** One quantity of many flights along time. */
export interface BandCurve {
  title: string;
  unit: string;
  help: string;
  moments: readonly BandMoment[];
  /** Whether larger values are drawn lower. */
  isDown: boolean;
}

/** First of the three columns of a row along time. */
const [DEPTH, CHARGE] = [7, 10] as const;
/** Column of a row along time: the part of the flights that is under way. */
const UNDER_WAY = 13;
/** Columns of a row along the legs: median time, and the longer half axis of the ellipse. */
const [TIME, LONG] = [2, 11] as const;

/** Depth, distance from the middle and charge along time. */
export function bandCurves({ along, over_time: rows, level }: FlightBand): BandCurve[] {
  const flights = `${Math.round(10 * level)} of 10 flights`;
  const column = (low: number, scale: number): BandMoment[] =>
    rows.map((row) => ({
      t: row[0],
      values: [0, 1, 2].map((k) => scale * (row[low + k] ?? 0)) as unknown as Three,
    }));
  const curves: BandCurve[] = [
    {
      title: 'Depth',
      unit: 'm',
      help: `Shaded: ${flights}. Line: the middle one. Flights that have ended float where they came up.`,
      moments: column(DEPTH, 1),
      isDown: true,
    },
    {
      title: 'Beside the track',
      unit: 'm',
      help: `${flights} are nearer to the middle of all flights than this.`,
      moments: along.map((row) => ({ t: row[TIME], values: [0, row[LONG], row[LONG]] })),
      isDown: false,
    },
    {
      title: 'Charge',
      unit: '%',
      help: `Shaded: ${flights}. Line: the middle one.`,
      moments: column(CHARGE, 100),
      isDown: false,
    },
  ];
  return curves.filter(({ moments }) => moments.length > 1 && (moments.at(-1)?.t ?? 0) > 0);
}

/** Flights are followed along time until twice the middle one's time: few stray on for hours. */
const LONGEST = 2;

/** Until when flights are drawn along time, s, and the part of them that goes on after that. */
export function drawnUntil({ duration_s, over_time }: FlightBand): { end: number; on: number } {
  const end = Math.max(1, Math.min(duration_s[2], LONGEST * duration_s[1]));
  const next = over_time.find((row) => row[0] >= end);
  return { end, on: end < duration_s[2] ? (next?.[UNDER_WAY] ?? 0) : 0 };
}

/** What may happen, and how likely that is. */
export interface Chance {
  what: string;
  /** The same of several flights. */
  many: string;
  share: number;
  help: string;
}

/** What may go wrong in a rehearsed flight; the worst first. */
export function chances(band: FlightBand): Chance[] {
  const ends = band.outcomes
    .slice()
    .sort((a, b) => b.share - a.share)
    .map(({ name, share }) => `${percent(share)} ${name}`);
  const domain = {
    what: 'Leaves the surveyed box',
    many: 'leave the surveyed box',
    share: band.leaves_domain,
    help: 'Outside of the box that surveys explore at some time.',
  };
  return [
    {
      what: 'Does not come back',
      many: 'do not come back',
      share: band.not_back,
      help: `Not as planned: the mission fails, or it ends outside of the water. Of the flights ${ends.join(', ')}.`,
    },
    {
      what: 'Leaves the water',
      many: 'leave the water',
      share: band.leaves_water,
      help: 'Outside of the shore or of the edge of the water at some time.',
    },
    ...band.touches.map(({ name, share }) => ({
      what: `Enters ${name}`,
      many: `enter ${name}`,
      share,
      help: 'In this keep-out at some time, at whatever depth.',
    })),
    {
      what: 'Cuts a dive short',
      many: 'cut a dive short',
      share: band.dives_cut,
      help: 'A limit, such as that of its uncertainty, brings it up early.',
    },
    ...(band.leaves_domain > 0 ? [domain] : []),
  ];
}

/** Above this a chance is shown as something to look at. */
export const CHANCE_WATCH = 0.05;

/** `1 in 20`, `7 in 10`, `none`, `nearly all`: a share as one would say it. */
export function oneIn(share: number): string {
  if (share <= 0) return 'none';
  if (share >= 1) return 'all';
  if (share < 0.15) return `1 in ${Math.round(1 / share)}`;
  const tenths = Math.round(10 * share);
  return tenths >= 10 ? 'nearly all' : `${tenths} in 10`;
}

/** `10 of 200`. */
export function ofFlights(share: number, flights: number): string {
  return share <= 0 ? `of ${flights}` : `${Math.round(share * flights)} of ${flights}`;
}

/** The chances that are worth a warning, as a sentence goes on: "1 in 8 does not come back". */
export function badChances(band: FlightBand | null | undefined): string[] {
  if (!band) return [];
  return chances(band)
    .filter(({ share }) => share > CHANCE_WATCH)
    .map(howMany);
}

/** Zero of finitely many is no proof: the chance that 95 of 100 such findings stay below. */
export function neverText(flights: number): string {
  return flights > 0
    ? `Of ${flights} flights none did, so it happens in fewer than ${percent(1 - 0.05 ** (1 / flights))} (95 % confidence).`
    : '';
}

/** What is to be known of a plan's chances in a line, such as before it is sent. */
export function chanceSentence(band: FlightBand, flights: number): string {
  const told = chances(band)
    .filter(({ share }) => share > 0)
    .map(howMany);
  return told.length > 0
    ? `Of ${flights} flights ahead ${told.join(', ')}.`
    : `In ${flights} flights ahead nothing went wrong.`;
}

function howMany({ what, many, share }: Chance): string {
  const often = oneIn(share);
  const does = what.charAt(0).toLowerCase() + what.slice(1);
  return `${often} ${often.startsWith('1 in') ? does : many}`;
}

function percent(share: number): string {
  const value = 100 * share;
  return `${value < 10 ? Number(value.toFixed(1)) : Math.round(value)} %`;
}
