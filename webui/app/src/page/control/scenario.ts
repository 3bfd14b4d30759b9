import type { Json, JsonObject } from '../../api/types';
import type { Draft } from '../../form/draft.svelte';
import { isObject, type FormNode } from '../../form/schema';
import { isSame, leaves, valueAt } from '../../form/value';
import { plainNumber, screenUnit } from '../../text/unit';
import { lower } from '../../text/word';

/** References that a field of the scenario is for; a field that is not here is for all. */
const ONLY_FOR: Readonly<Record<string, readonly string[]>> = {
  straight: ['straight_glide', 'level_swim'],
  'straight.glide_angle_rad': ['straight_glide'],
  'straight.vertical_speed_m_s': ['straight_glide'],
  'straight.swim_speed_m_s': ['level_swim'],
};

/** Whether a field of the scenario means anything: noise of exact sensors does not. */
export function isScenarioField(path: readonly string[], scenario: JsonObject): boolean {
  const { reference, sensing, disturbance } = scenario;
  if (['current_north_m_s', 'current_east_m_s'].includes(path[1] ?? '')) {
    return !(isObject(disturbance) && disturbance.current_source === 'map');
  }
  if (path.length > 1 && path[0] === 'sensing' && path[1] !== 'exact') {
    return !(isObject(sensing) && sensing.exact === true);
  }
  const references = ONLY_FOR[path.join('.')];
  return typeof reference !== 'string' || !references || references.includes(reference);
}

/** Told of every scenario, whether it is as it was delivered or not. */
const ALWAYS = ['duration_s', 'model'];

/** A scenario in words: what it always has, then what differs from the preset. */
export function scenarioWords(form: Draft, scenario: JsonObject): string[] {
  const told = leaves(form.tree).filter((node) => {
    const [first = ''] = node.path;
    if (first === 'reference' || !isMeant(node.path, scenario)) return false;
    const known = form.default(node);
    return ALWAYS.includes(first) || !isSame(known, valueAt(scenario, node.path));
  });
  const rank = ({ path }: FormNode) => (ALWAYS.includes(path[0] ?? '') ? 0 : 1);
  return told
    .toSorted((a, b) => rank(a) - rank(b))
    .map((node) => {
      const group = form.tree.members.find(({ path }) => path[0] === node.path[0]);
      const name =
        node.path.length > 1 && group ? `${group.title}: ${lower(node.title)}` : node.title;
      return `${name} ${valueWords(node, valueAt(scenario, node.path))}`;
    });
}

/** Whether a field and every group around it mean something. */
function isMeant(path: readonly string[], scenario: JsonObject): boolean {
  return path.every((_, i) => isScenarioField(path.slice(0, i + 1), scenario));
}

function valueWords(node: FormNode, value: Json | undefined): string {
  if (typeof value === 'boolean') return value ? 'yes' : 'no';
  if (node.kind === 'choice') {
    return node.choices.find((choice) => choice.value === value)?.title.toLowerCase() ?? '–';
  }
  if (node.kind !== 'number' || typeof value !== 'number') return JSON.stringify(value);
  const { factor, label } = screenUnit(node.unit, node.displayUnit);
  return `${plainNumber(value * factor, 4).replace('-', '\u2212')}${label ? ` ${label}` : ''}`;
}
