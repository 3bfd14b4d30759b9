import { words } from './word';

interface ModelWords {
  short: string;
  help: string;
}

const MODELS: Record<string, ModelWords> = {
  single: {
    short: 'Single',
    help: 'One Gaussian process that takes every position for exact and trusts every sample equally.',
  },
  recursive: {
    short: 'Recursive',
    help: 'A chain of Gaussian processes: well located samples correct poorly located ones.',
  },
  joint: {
    short: 'Joint',
    help: 'One Gaussian process over all fidelities at once: well located samples also make the map surer where poorly located ones were taken.',
  },
  position_noise: {
    short: 'Position noise',
    help: 'One Gaussian process that trusts a sample less where the field is steep and the position unsure.',
  },
};

/** What a map's model does, in a sentence. */
export function modelHelp(model: string): string {
  return MODELS[model]?.help ?? '';
}

/** What a map's model is called; the station's own title where it tells one. */
export function modelTitle(model: string, titles?: Readonly<Record<string, string>>): string {
  return titles?.[model] ?? words(model);
}

/** A model's name for tables; a model that the app does not know keeps the station's title. */
export function shortModelTitle(model: string, title?: string): string {
  return MODELS[model]?.short ?? (title || words(model));
}

/** The long name and what the model does, for a tooltip. */
export function modelNote(model: string, title?: string): string {
  return [title, modelHelp(model)].filter(Boolean).join('. ');
}
