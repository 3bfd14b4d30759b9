import type { Client } from 'openapi-fetch';
import { of, told } from './call';
import type { paths } from './generated/station';

/** What is expected of robots: where they should be, and how long their batteries last. */
export class OutlookApi {
  readonly #http: Client<paths, 'application/json'>;

  constructor(http: Client<paths, 'application/json'>) {
    this.#http = http;
  }

  prediction = (robot: string) =>
    told(this.#http.GET('/api/robots/{robot}/prediction', of({ robot })));
  judged = (robot: string, limit: number) =>
    told(this.#http.GET('/api/robots/{robot}/predictions', of({ robot }, { limit })));
  battery = (robot: string) => told(this.#http.GET('/api/robots/{robot}/battery', of({ robot })));
}
