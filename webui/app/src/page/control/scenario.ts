import type { JsonObject } from '../../api/types';
import { isObject } from '../../form/schema';

/** References that a field of the scenario is for; a field that is not here is for all. */
const ONLY_FOR: Readonly<Record<string, readonly string[]>> = {
  straight: ['straight_glide', 'level_swim'],
  'straight.glide_angle_rad': ['straight_glide'],
  'straight.vertical_speed_m_s': ['straight_glide'],
  'straight.swim_speed_m_s': ['level_swim'],
};

/** Whether a field of the scenario means anything: noise of exact sensors does not. */
export function isScenarioField(path: readonly string[], scenario: JsonObject): boolean {
  const { reference, sensing } = scenario;
  if (path.length > 1 && path[0] === 'sensing' && path[1] !== 'exact') {
    return !(isObject(sensing) && sensing.exact === true);
  }
  const references = ONLY_FOR[path.join('.')];
  return typeof reference !== 'string' || !references || references.includes(reference);
}
