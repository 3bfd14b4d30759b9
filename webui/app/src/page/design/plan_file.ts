import type { components, paths } from '../../api/generated/station';

type Schemas = components['schemas'];

export type PlanFile = Schemas['PlanFileView'];
export type Question = Schemas['Question'];
export type Loss = Schemas['LossView'];
export type FileFormat =
  paths['/api/designs/{design}/file']['get']['parameters']['query']['format'];

/** How a person answered what a file leaves open, by the key of the question. */
export type Answers = Readonly<Record<string, boolean | number | undefined>>;

export const FORMATS: readonly { key: FileFormat; title: string; ending: string }[] = [
  { key: 'qgc_plan', title: 'QGroundControl plan', ending: '.plan' },
  { key: 'wpl', title: 'QGC WPL 110', ending: '.waypoints' },
  { key: 'kml', title: 'KML', ending: '.kml' },
  { key: 'geojson', title: 'GeoJSON', ending: '.geojson' },
  { key: 'csv', title: 'CSV', ending: '.csv' },
];

/** What an answer is: a number of metres, one of the areas, or yes. */
export function kindOf(question: Question): 'number' | 'area' | 'yes' {
  if (question.key === 'area') return 'area';
  return question.unit ? 'number' : 'yes';
}

/** What the station is sent of the answers: a question that is not answered is left out. */
export function choicesOf(answers: Answers): string {
  const said = Object.entries(answers).filter(
    ([, value]) => value !== undefined && value !== false,
  );
  return JSON.stringify(Object.fromEntries(said));
}

/** Questions that stay on the form: those of the last reading, and those that were answered. */
export function asked(found: PlanFile, before: readonly Question[], answers: Answers) {
  const keys = new Set(found.needs.map(({ key }) => key));
  const kept = before.filter(({ key }) => !keys.has(key) && answers[key] !== undefined);
  return [...found.needs, ...kept.map((one) => ({ ...one, is_needed: false }))];
}

/** Name of a design as its file has it. */
export function nameOf(file: string, taken: readonly string[]): string {
  const title = file.replace(/\.[^.]*$/, '').slice(0, 56) || 'Imported';
  let [name, number] = [title, 1];
  while (taken.includes(name)) name = `${title} ${++number}`;
  return name;
}

/** What a design of the file would be, in words. */
export function summaryOf({ document, distance_m }: PlanFile): string {
  const { content } = document;
  if (content.kind !== 'waypoints') return content.kind.replaceAll('_', ' ');
  const count = content.waypoints.length;
  if (count === 0) return 'no waypoint';
  return `${count} ${count === 1 ? 'waypoint' : 'waypoints'} over ${distance_m.toFixed(1)} m`;
}
