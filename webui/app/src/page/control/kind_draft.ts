import type { Api } from '../../api/client';
import type { JsonObject } from '../../api/types';
import { Draft, type Needs } from '../../form/draft.svelte';

/** Settings of one kind for one robot, as a form to be filled and never stored. */
export interface KindDraft {
  draft: Draft;
  /** What the station keeps for the robot. */
  own: JsonObject;
  /** Gains for exact states, where a kind has them. */
  simulation: JsonObject | null;
}

/** Read a kind's form; a trial of a controller begins with its gains for exact states. */
export async function readKind(
  api: Api,
  kind: string,
  robot: string,
  needs?: Needs,
): Promise<KindDraft> {
  const [schema, { value: document }] = await Promise.all([
    api.configSchema(kind),
    api.config(kind, robot),
  ]);
  const own = document.value;
  const simulation = document.simulation_preset ?? null;
  const first = simulation ?? own;
  return { draft: new Draft(schema, first, simulation ?? document.preset, needs), own, simulation };
}
