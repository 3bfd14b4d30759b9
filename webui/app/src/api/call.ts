import type { Versioned } from './client';

/** How the app calls the station's routes and takes their answers. */

/** Where a request goes and what it asks. */
export function of<P, Q = undefined>(path: P, query?: Q, signal?: AbortSignal) {
  return { params: { path, query: query as Q }, ...(signal && { signal }) };
}

export async function told<T>(answer: Promise<{ data?: T }>): Promise<T> {
  return (await answer).data as T;
}

export async function done(answer: Promise<unknown>): Promise<void> {
  await answer;
}

export function versioned<T>({ data, response }: { data?: T; response: Response }): Versioned<T> {
  return { value: data as T, etag: response.headers.get('ETag') };
}

/** One key a request, so that a repeated request acts once. */
export function newKey(): string {
  const bytes = crypto.getRandomValues(new Uint8Array(16));
  return Array.from(bytes, (byte) => byte.toString(16).padStart(2, '0')).join('');
}
