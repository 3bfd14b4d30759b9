/** A refusal of the station, in words that can be shown as they are. */
export class Problem extends Error {
  constructor(
    readonly status: number,
    readonly title: string,
    readonly detail: string,
    readonly errors: readonly FieldError[] = [],
    readonly type = '',
  ) {
    super(detail || title);
    this.name = 'Problem';
  }

  /** One sentence for the person at the screen. */
  get sentence(): string {
    const said = this.detail || this.title;
    return /[.?]$/.test(said) ? said : `${said}.`;
  }
}

/** What is wrong with one field; `path` leads from the document's root to it. */
export interface FieldError {
  path: string[];
  message: string;
}

const NO_ANSWER = 'The station did not answer; whether it took this is not known.';

export function noAnswer(): Problem {
  return new Problem(0, NO_ANSWER, '');
}

/** Read a refusal; anything that is no problem document is named by its status alone. */
export async function problemOf(response: Response): Promise<Problem> {
  const body: unknown = await response.json().catch(() => null);
  if (!isRecord(body)) {
    return new Problem(response.status, `The station answered ${response.status}`, '');
  }
  return new Problem(
    response.status,
    text(body.title) || `The station answered ${response.status}`,
    text(body.detail),
    fieldErrors(body.errors),
    text(body.type),
  );
}

/** Sentence for anything that was thrown. */
export function sentence(error: unknown): string {
  if (error instanceof Problem) return error.sentence;
  return error instanceof Error ? error.message : 'Something unforeseen went wrong.';
}

/** The same with what is wrong with each field, where no form shows it beside the field. */
export function wholeSentence(error: unknown): string {
  const faults = error instanceof Problem ? error.errors : [];
  const told = faults.map(({ path, message }) =>
    `${path.join(' ')}: ${message}`.replace(/^: /, ''),
  );
  return [sentence(error), ...told].join(' ');
}

function fieldErrors(value: unknown): FieldError[] {
  if (!Array.isArray(value)) return [];
  return value.filter(isRecord).map((error) => ({
    path: locationPath(error.loc),
    message: text(error.msg) || text(error.message),
  }));
}

/** Path of a field, whether the station wrote it as a list or with dots. */
export function locationPath(location: unknown): string[] {
  const parts = Array.isArray(location) ? location.map(String) : text(location).split('.');
  const start = parts.findIndex((part) => !['body', 'config', 'value', ''].includes(part));
  return start < 0 ? [] : parts.slice(start);
}

function isRecord(value: unknown): value is Record<string, unknown> {
  return typeof value === 'object' && value !== null && !Array.isArray(value);
}

function text(value: unknown): string {
  return typeof value === 'string' ? value : '';
}
