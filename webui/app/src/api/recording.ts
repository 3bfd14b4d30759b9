import type { Client } from 'openapi-fetch';
import { of, told } from './call';
import type { components, paths } from './generated/station';

type Schemas = components['schemas'];

/** Recordings of any maker: sent, proposed, confirmed. */
export class RecordingApi {
  readonly #http: Client<paths, 'application/json'>;

  constructor(http: Client<paths, 'application/json'>) {
    this.#http = http;
  }

  upload(files: readonly File[]): Promise<Schemas['JobView']> {
    const form = new FormData();
    for (const file of files) form.append('files', file);
    const body = { files: files.map((file) => file.name) };
    return told(this.#http.POST('/api/imports/uploads', { body, bodySerializer: () => form }));
  }

  /** Columns of imported files that are no channel. */
  otherSeries = (deployment: string) =>
    told(this.#http.GET('/api/deployments/{deployment}/series', of({ deployment })));

  confirm = (upload: string, body: Schemas['Confirmation']) =>
    told(this.#http.POST('/api/imports/uploads/{upload}', { ...of({ upload }), body }));
}
