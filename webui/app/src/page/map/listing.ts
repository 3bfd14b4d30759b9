import type { MapListing } from '../../api/types';
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

export function modelTitle(of: { model: string; title: string }): { title: string; help: string } {
  const known = MODELS[of.model];
  return { title: of.title || known?.title || words(of.model), help: known?.help ?? '' };
}

/** The maps that a robot has, from any of the forms in which a list can be sent. */
export function mapListings(answer: unknown): MapListing[] {
  const list = isRecord(answer) ? (answer.maps ?? answer.variables ?? []) : answer;
  if (!Array.isArray(list)) return [];
  return list.filter(isRecord).map((entry) => ({
    variable: text(entry.variable) || text(entry.key),
    title: text(entry.title) || words(text(entry.variable)),
    unit: text(entry.unit),
    models: (Array.isArray(entry.models) ? entry.models : []).map((model) =>
      isRecord(model)
        ? { model: text(model.model) || text(model.key), title: text(model.title) }
        : { model: String(model), title: '' },
    ),
  }));
}

function isRecord(value: unknown): value is Record<string, unknown> {
  return typeof value === 'object' && value !== null && !Array.isArray(value);
}

function text(value: unknown): string {
  return typeof value === 'string' ? value : '';
}
