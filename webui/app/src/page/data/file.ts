/** What a file would be if it were written now, by its mode. */
export const MODES: Readonly<Record<'R' | 'P' | 'D', string>> = {
  R: 'Mode R: from telemetry, as it stands now. Once the deployment is reviewed, files have mode D.',
  P: 'Mode P: recovered, and not reviewed yet. Once it is reviewed, files have mode D.',
  D: 'Mode D: reviewed and signed, with places smoothed where a fix ended the dive.',
};

/** Who checks. */
export const SUITES: Readonly<Record<string, string>> = {
  own: 'Own checks',
  'og:1.0': 'OG1.0',
  'cf:1.10': 'CF-1.10',
};

/** What a check came to, by word, colour and shape. */
export const CHECK_LOOKS: Readonly<
  Record<'passed' | 'findings' | 'unchecked', { title: string; shape: string; tone: string }>
> = {
  passed: { title: 'passed', shape: '●', tone: '' },
  findings: { title: 'does not pass', shape: '✕', tone: 'tone-alarm' },
  unchecked: { title: 'could not be checked', shape: '◆', tone: 'tone-watch' },
};
