import type { Client } from 'openapi-fetch';
import { of, told } from './call';
import type { components, paths } from './generated/station';
import { upload } from './upload';

type Schemas = components['schemas'];
export type LogGroup = Schemas['LogItemView']['group'];

/** What of the log book is asked for. */
export interface LogQuery {
  readonly group?: LogGroup[];
  readonly robot?: string | null;
  readonly deployment?: string | null;
  readonly author?: string | null;
  readonly tag?: string | null;
  readonly text?: string;
  readonly shift?: 'mine' | 'two' | null;
  readonly from?: string | null;
  readonly to?: string | null;
  readonly before?: string | null;
  readonly limit?: number;
}

/** The log book: what people write, their shifts, and the pages that they sign. */
export class LogBookApi {
  readonly #http: Client<paths, 'application/json'>;
  readonly #csrf: () => string;

  constructor(http: Client<paths, 'application/json'>, csrf: () => string) {
    this.#http = http;
    this.#csrf = csrf;
  }

  read = (query: LogQuery) => told(this.#http.GET('/api/logbook', { params: { query } }));
  words = () => told(this.#http.GET('/api/logbook/words'));
  entry = (entry: string) => told(this.#http.GET('/api/logbook/entries/{entry}', of({ entry })));
  write = (body: Schemas['NewEntry']) => told(this.#http.POST('/api/logbook/entries', { body }));
  change = (entry: string, body: Schemas['EntryChanges']) =>
    told(this.#http.PATCH('/api/logbook/entries/{entry}', { ...of({ entry }), body }));
  strike = (entry: string, version: number) =>
    told(this.#http.DELETE('/api/logbook/entries/{entry}', of({ entry }, { version })));
  /** Keep a picture that an entry will have. */
  keepPicture(file: File): Promise<Schemas['AttachmentView']> {
    const form = new FormData();
    form.set('file', file);
    return upload({ path: '/api/logbook/attachments', form, csrf: this.#csrf() });
  }

  shifts = (limit: number) =>
    told(this.#http.GET('/api/logbook/shifts', { params: { query: { limit } } }));
  beginShift = () => told(this.#http.POST('/api/logbook/shifts'));
  endShift = () => told(this.#http.POST('/api/logbook/shifts/end'));
  handover = () => told(this.#http.GET('/api/logbook/handover'));
  pages = (limit: number) =>
    told(this.#http.GET('/api/logbook/pages', { params: { query: { limit } } }));
  page = (page: string) => told(this.#http.GET('/api/logbook/pages/{page}', of({ page })));
  sign = (body: Schemas['PageToSign']) => told(this.#http.POST('/api/logbook/pages', { body }));
  take = (page: string, sha256: string) =>
    told(this.#http.POST('/api/logbook/pages/{page}/take', { ...of({ page }), body: { sha256 } }));
}

/** Where the bytes of a picture are. */
export function picturePath(sha256: string): string {
  return `/api/logbook/attachments/${sha256}`;
}
