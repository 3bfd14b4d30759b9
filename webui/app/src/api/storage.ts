import type { Client } from 'openapi-fetch';
import { told, versioned } from './call';
import type { Versioned } from './client';
import type { components, paths } from './generated/station';
import type { ConfigDocument, JsonObject } from './types';

type Schemas = components['schemas'];

export type Look = Schemas['LookView'];
export type KindSize = Schemas['KindSizeView'];
export type Storage = Schemas['StoredSizesView'];
export type Preview = Schemas['StoragePreviewResult'];

const KIND = { kind: 'storage' } as const;

/** What the station keeps, and what becomes of it. */
export class StorageApi {
  readonly #http: Client<paths, 'application/json'>;

  constructor(http: Client<paths, 'application/json'>) {
    this.#http = http;
  }

  get = () => told(this.#http.GET('/api/storage'));

  async rules(): Promise<Versioned<ConfigDocument>> {
    return versioned(await this.#http.GET('/api/config/{kind}', { params: { path: KIND } }));
  }

  async changeRules(body: JsonObject, etag: string | null): Promise<Versioned<ConfigDocument>> {
    const params = { path: KIND, header: etag ? { 'if-match': etag } : {} };
    return versioned(await this.#http.PATCH('/api/config/{kind}', { params, body }));
  }

  /** Look at what would go by rules, the changed ones given. */
  preview = (body: JsonObject) => told(this.#http.POST('/api/storage/preview', { body }));
  /** Thin, move and delete at once what is due. */
  prune = () => told(this.#http.POST('/api/storage/passes'));
}
