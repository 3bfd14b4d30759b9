import type { FieldMap, ShareAbove } from '../../api/types';
import { screenUnit } from '../../text/unit';

/** Between these probabilities the map does not know on which side of the threshold a place is. */
export const PROBABILITY_STEPS = [0.05, 0.5, 0.95] as const;

/** What each step of colour says, the least probable first. */
export const STEP_TITLES = [
  'below, 95 % sure',
  'rather below',
  'rather above',
  'above, 95 % sure',
] as const;

/** Distribution function of the standard normal; accurate to 1e-7 (Abramowitz and Stegun 26.2.17). */
export function normalShare(z: number): number {
  const t = 1 / (1 + 0.2316419 * Math.abs(z));
  const series =
    t *
    (0.31938153 + t * (-0.356563782 + t * (1.781477937 + t * (-1.821255978 + t * 1.330274429))));
  const tail = (series * Math.exp(-0.5 * z * z)) / Math.sqrt(2 * Math.PI);
  return z >= 0 ? 1 - tail : tail;
}

/** Probability that the field is above a value, in the order of the map’s own values. */
export function probabilitiesAbove(
  { mean, std, scale }: Pick<FieldMap, 'mean' | 'std' | 'scale'>,
  above: number,
): (number | null)[] {
  const level = scale === 'log' ? (above > 0 ? Math.log(above) : -Infinity) : above;
  return mean.map((value, i) => {
    const deviation = std[i] ?? null;
    if (value === null || deviation === null) return null;
    return normalShare((value - level) / Math.max(deviation, 1e-12));
  });
}

/** Index of the step of colour that a probability falls into. */
export function stepOf(probability: number): number {
  return PROBABILITY_STEPS.filter((edge) => probability >= edge).length;
}

/** How much of the water is above the value, in one sentence. */
export function shareSentence({ low, high, above, unit }: ShareAbove): string {
  const [least, most] = [Math.round(100 * low), Math.round(100 * high)];
  const value = `${Number(above.toPrecision(4))} ${screenUnit(unit).label}`;
  if (least === most) return `About ${least} % of the water is above ${value}.`;
  return `Between ${least} and ${most} % of the water is above ${value}.`;
}

/** A round value in the middle of a map, to begin with where nobody set a threshold. */
export function middleOf({ mean, scale }: Pick<FieldMap, 'mean' | 'scale'>): number {
  const known = mean.filter((value) => value !== null).toSorted((a, b) => a - b);
  const middle = known[Math.floor(known.length / 2)] ?? 0;
  return Number((scale === 'log' ? Math.exp(middle) : middle).toPrecision(2));
}
