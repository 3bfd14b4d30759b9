import type { Client } from 'openapi-fetch';
import { done, of, told } from './call';
import type { components, paths } from './generated/station';

type Schemas = components['schemas'];

/** Who and what may speak with the station: people, tokens of scripts, keys of robots. */
export class AccessApi {
  readonly #http: Client<paths, 'application/json'>;

  constructor(http: Client<paths, 'application/json'>) {
    this.#http = http;
  }

  people = async () => (await told(this.#http.GET('/api/people'))).people;

  addPerson = (body: Schemas['PersonBody']) => told(this.#http.POST('/api/people', { body }));

  changePerson = (name: string, body: Schemas['PersonPatch']) =>
    told(this.#http.PATCH('/api/people/{name}', { ...of({ name }), body }));

  tokens = async () => (await told(this.#http.GET('/api/tokens'))).tokens;
  createToken = (body: Schemas['TokenBody']) => told(this.#http.POST('/api/tokens', { body }));
  revokeToken = (token: string) => done(this.#http.DELETE('/api/tokens/{token}', of({ token })));

  groups = async () => (await told(this.#http.GET('/api/groups'))).groups;
  /** Let a group have robots; `seen` are those that it had when somebody looked. */
  putGroup = (group: string, robots: string[], seen: string[]) =>
    done(this.#http.PUT('/api/groups/{group}', { ...of({ group }), body: { robots, seen } }));
  removeGroup = (group: string) => done(this.#http.DELETE('/api/groups/{group}', of({ group })));

  sessions = async (everybody: boolean) =>
    (await told(this.#http.GET('/api/sessions', { params: { query: { everybody } } }))).sessions;
  endSession = (session: string) =>
    done(this.#http.DELETE('/api/sessions/{session}', of({ session })));
  endOtherSessions = () => done(this.#http.DELETE('/api/sessions'));

  links = async () => (await told(this.#http.GET('/api/read-only-links'))).links;
  createLink = (body: Schemas['LinkBody']) =>
    told(this.#http.POST('/api/read-only-links', { body }));
  revokeLink = (link: string) =>
    done(this.#http.DELETE('/api/read-only-links/{link}', of({ link })));

  /** The name of the provider that one may sign in by; `null` for none. */
  provider = async () => (await told(this.#http.GET('/api/session/provider'))).title;

  signing = async () => (await told(this.#http.GET('/api/signing'))).robots;
  makeSigningKey = (robot: string) =>
    told(this.#http.POST('/api/robots/{robot}/signing-key', of({ robot })));
  turnSigningOff = (robot: string) =>
    done(this.#http.DELETE('/api/robots/{robot}/signing-key', of({ robot })));
}
