import { noAnswer, problemOf } from './problem';

export type Query = Record<string, string | number | boolean | null | undefined>;

export interface Call {
  query?: Query;
  body?: unknown;
  form?: FormData;
  headers?: Record<string, string>;
  signal?: AbortSignal | undefined;
}

/** One request at a time to the station; every refusal is thrown as a Problem. */
export class Road {
  /** Proves to the station that a request comes from its own page. */
  csrf = '';
  /** Called when the station no longer knows this browser. */
  onSignedOut: () => void = () => undefined;

  async json<T>(method: string, path: string, call: Call = {}): Promise<T> {
    const response = await this.send(method, path, call);
    return (await response.json()) as T;
  }

  async send(method: string, path: string, call: Call = {}): Promise<Response> {
    const headers = new Headers({ Accept: 'application/json', ...call.headers });
    if (method !== 'GET') {
      headers.set('X-CSRF-Token', this.csrf);
      if (method === 'POST') headers.set('Idempotency-Key', newKey());
    }
    let body: BodyInit | undefined = call.form;
    if (call.body !== undefined) {
      headers.set('Content-Type', 'application/json');
      body = JSON.stringify(call.body);
    }
    let response: Response;
    try {
      response = await fetch(path + queryString(call.query), {
        method,
        headers,
        body: body ?? null,
        signal: call.signal ?? null,
        credentials: 'same-origin',
      });
    } catch (error) {
      if (error instanceof DOMException && error.name === 'AbortError') throw error;
      throw noAnswer();
    }
    if (response.ok) return response;
    if (response.status === 401 && path !== '/api/session') this.onSignedOut();
    throw await problemOf(response);
  }
}

export function at(robot: string): string {
  return `/api/robots/${part(robot)}`;
}

/** A list, whether it comes bare or as the one list of an object. */
export type Listed<T> = T[] | Record<string, T[]>;

export function listed<T>(answer: Listed<T>): T[] {
  return Array.isArray(answer) ? answer : (Object.values(answer)[0] ?? []);
}

export function part(value: string): string {
  return encodeURIComponent(value);
}

export function queryString(query: Query = {}): string {
  const pairs = new URLSearchParams();
  for (const [name, value] of Object.entries(query)) {
    if (value !== null && value !== undefined) pairs.set(name, String(value));
  }
  const text = pairs.toString();
  return text && `?${text}`;
}

/** One key a request, so that a repeated request acts once. */
function newKey(): string {
  const bytes = crypto.getRandomValues(new Uint8Array(16));
  return Array.from(bytes, (byte) => byte.toString(16).padStart(2, '0')).join('');
}
