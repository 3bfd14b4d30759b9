import type { Client } from 'openapi-fetch';
import { of, told } from './call';
import type { paths } from './generated/station';

/** What is expected of robots: where they should be, how long they are up, what would be better. */
export class OutlookApi {
  readonly #http: Client<paths, 'application/json'>;

  constructor(http: Client<paths, 'application/json'>) {
    this.#http = http;
  }

  prediction = (robot: string) =>
    told(this.#http.GET('/api/robots/{robot}/prediction', of({ robot })));
  judged = (robot: string, limit: number) =>
    told(this.#http.GET('/api/robots/{robot}/predictions', of({ robot }, { limit })));
  contact = (robot: string) => told(this.#http.GET('/api/robots/{robot}/contact', of({ robot })));
  suggestion = (robot: string) =>
    told(this.#http.GET('/api/robots/{robot}/suggestion', of({ robot })));
  /** Have a better plan searched for; nothing is sent. */
  askForSuggestion = (robot: string) =>
    told(this.#http.POST('/api/robots/{robot}/suggestion', of({ robot })));
  /** What each of some plans would tell of the map, in their order. */
  comparePlans = (robot: string, plan: string[]) =>
    told(this.#http.GET('/api/robots/{robot}/plans/comparison', of({ robot }, { plan })));
  battery = (robot: string) => told(this.#http.GET('/api/robots/{robot}/battery', of({ robot })));
}
