/** How far settings go, for the person who changes them. */
export interface Reach {
  /** Whether the robot gets them at all. */
  isCarried: boolean;
  /** Beside the title. */
  text: string;
}

/** What the station says of a kind of settings; where it says nothing, the kind tells. */
export function reachOf(kind: string, said: { reach?: string; reach_text?: string }): Reach {
  const isCarried = said.reach ? said.reach !== 'none' : !isKept(kind);
  const own = isCarried ? '' : 'Not on board: the robot flies its own settings.';
  return { isCarried, text: said.reach_text ?? own };
}

function isKept(kind: string): boolean {
  return kind.startsWith('controller.') || kind === 'estimator';
}
