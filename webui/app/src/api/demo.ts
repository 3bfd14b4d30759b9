import type { Client } from 'openapi-fetch';
import { done, of, told } from './call';
import type { paths } from './generated/station';

/** Faults of robots that do not exist. */
export class DemoApi {
  readonly #http: Client<paths, 'application/json'>;

  constructor(http: Client<paths, 'application/json'>) {
    this.#http = http;
  }

  /** Faults that simulated robots can have, and those that they have. */
  faults = () => told(this.#http.GET('/api/demo/faults'));

  cause = (robot: string, fault: string) =>
    done(this.#http.PUT('/api/demo/faults/{robot}/{fault}', of({ robot, fault })));

  mend = (robot: string, fault: string) =>
    done(this.#http.DELETE('/api/demo/faults/{robot}/{fault}', of({ robot, fault })));
}
