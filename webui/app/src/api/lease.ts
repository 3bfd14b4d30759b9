import type { Client } from 'openapi-fetch';
import { of, told } from './call';
import type { components, paths } from './generated/station';

type Schemas = components['schemas'];

/** Who is in charge of which robot, and the hold on automation. */
export class LeaseApi {
  readonly #http: Client<paths, 'application/json'>;

  constructor(http: Client<paths, 'application/json'>) {
    this.#http = http;
  }

  leases = () => told(this.#http.GET('/api/leases'));

  change = (robot: string, body: Schemas['LeaseChange']) =>
    told(this.#http.POST('/api/robots/{robot}/lease', { ...of({ robot }), body }));

  /** Give back every robot that this person is in charge of. */
  releaseAll = () => told(this.#http.POST('/api/leases/release'));

  /** Let a script act under one's own lease; `null` lets none. */
  letScript = (robot: string, token: string | null) =>
    told(this.#http.PUT('/api/robots/{robot}/lease/script', { ...of({ robot }), body: { token } }));

  automation = () => told(this.#http.GET('/api/automation'));

  holdAutomation = (is_held: boolean, reason = '') =>
    told(this.#http.PUT('/api/automation', { body: { is_held, reason } }));
}
