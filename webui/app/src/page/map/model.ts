import { words } from '../../text/word';

const HELP: Record<string, string> = {
  single:
    'One Gaussian process that takes every position for exact and trusts every sample equally.',
  recursive: 'A chain of Gaussian processes: well located samples correct poorly located ones.',
  joint:
    'One Gaussian process over all fidelities at once: well located samples also make the map surer where poorly located ones were taken.',
  position_noise:
    'One Gaussian process that trusts a sample less where the field is steep and the position unsure.',
};

/** What a map's model does, in a sentence. */
export function modelHelp(model: string): string {
  return HELP[model] ?? '';
}

/** What a map's model is called; the station's own title where it tells one. */
export function modelTitle(model: string, titles?: Readonly<Record<string, string>>): string {
  return titles?.[model] ?? words(model);
}
