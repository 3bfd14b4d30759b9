import type { Client } from 'openapi-fetch';
import { told } from './call';
import type { components, paths } from './generated/station';

type Schemas = components['schemas'];

export type Look = Schemas['LookView'];
export type KindSize = Schemas['KindSizeView'];

/** What the station keeps, and what becomes of it. */
export class StorageApi {
  readonly #http: Client<paths, 'application/json'>;

  constructor(http: Client<paths, 'application/json'>) {
    this.#http = http;
  }

  get = () => told(this.#http.GET('/api/storage'));
}
