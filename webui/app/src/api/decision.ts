import type { Client } from 'openapi-fetch';
import type { components, paths } from './generated/station';
import { of, told } from './call';

export type Decision = components['schemas']['DecisionView'];

/** What the station decided, and whether it is decided the same once more. */
export class DecisionApi {
  readonly #http: Client<paths, 'application/json'>;

  constructor(http: Client<paths, 'application/json'>) {
    this.#http = http;
  }

  list = (robot: string) => told(this.#http.GET('/api/robots/{robot}/decisions', of({ robot })));
  replay = (robot: string) =>
    told(this.#http.POST('/api/robots/{robot}/decisions/replay', of({ robot })));
}
