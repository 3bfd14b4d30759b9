import type { Client } from 'openapi-fetch';
import { told } from './call';
import type { components, paths } from './generated/station';

type Schemas = components['schemas'];
export type BackupSettings = Required<Schemas['BackupSettings']>;
export type Backups = Schemas['BackupsView'] & { settings: BackupSettings };

/** Backups of the station, and when it makes them. */
export class BackupApi {
  readonly #http: Client<paths, 'application/json'>;

  constructor(http: Client<paths, 'application/json'>) {
    this.#http = http;
  }

  get = async () => (await told(this.#http.GET('/api/backups'))) as Backups;
  save = (body: BackupSettings) => told(this.#http.PUT('/api/backups/settings', { body }));
  begin = () => told(this.#http.POST('/api/backups'));
}
