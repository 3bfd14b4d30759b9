/** What a person must know of how far settings go. */
export interface Reach {
  /** Beside the title: whether the robot gets them. */
  text: string;
  /** What they are for, in full. */
  help: string;
  isCarried: boolean;
  /** After they were stored. */
  outcome: string;
}

const STATION = 'station';

/** What the station says of a kind of settings; where it says nothing, the kind tells. */
export function reachOf(kind: string, said: string | null | undefined, robot: string): Reach {
  const known = said ?? (isKept(kind) ? STATION : 'plan');
  if (known === STATION) {
    return {
      text: `Kept at the station, not carried to ${robot}`,
      help: kept(kind, robot),
      isCarried: false,
      outcome: `${robot} is not told.`,
    };
  }
  const isPlain = known === 'plan' || known === 'robot';
  return {
    text: isPlain ? '' : known,
    help: '',
    isCarried: true,
    outcome: 'It holds from the next plan on.',
  };
}

function isKept(kind: string): boolean {
  return kind.startsWith('controller.') || ['estimator', 'trial', 'identification'].includes(kind);
}

function kept(kind: string, robot: string): string {
  if (kind.startsWith('controller.')) {
    return `What-if runs use these gains. ${robot} itself flies with those of its own program, which change only there.`;
  }
  if (kind === 'estimator') {
    return `The station counts with them. ${robot} itself estimates with the settings of its own program, which change only there.`;
  }
  return `${robot} has no use for them: they are what the station begins its own computations with.`;
}
