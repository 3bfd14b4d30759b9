import { words } from '../../text/word';

const MODELS: Record<string, { title: string; help: string }> = {
  single: {
    title: 'One fidelity',
    help: 'A single Gaussian process that trusts every sample equally.',
  },
  recursive: {
    title: 'Three fidelities',
    help: 'A chain of Gaussian processes: well located samples correct poorly located ones.',
  },
};

/** What a map's model is called on the screen. */
export function modelTitle(model: string): { title: string; help: string } {
  return MODELS[model] ?? { title: words(model), help: '' };
}
