import type { Deployment } from '../../api/types';

/** A flag as a person reads it: by word, colour and shape. */
export interface FlagLook {
  flag: number;
  title: string;
  shape: string;
  tone: string;
}

/** Flags that a person sets, in the numbers of OG1.0. */
export const FLAGS: readonly FlagLook[] = [
  { flag: 1, title: 'Good', shape: '●', tone: '' },
  { flag: 2, title: 'Probably good', shape: '○', tone: '' },
  { flag: 3, title: 'Probably bad', shape: '◆', tone: 'tone-watch' },
  { flag: 4, title: 'Bad', shape: '✕', tone: 'tone-alarm' },
];

const NONE: FlagLook = { flag: 0, title: 'Not evaluated', shape: '·', tone: '' };

export function flagOf(flag: number): FlagLook {
  return FLAGS.find((one) => one.flag === flag) ?? NONE;
}

/** States of a deployment in which flags are set: nobody answers for its data yet. */
export const MAY_FLAG: readonly Deployment['state'][] = ['in_water', 'recovered'];
