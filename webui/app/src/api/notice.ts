import type { Client } from 'openapi-fetch';
import { done, of, told } from './call';
import type { components, paths } from './generated/station';

type Schemas = components['schemas'];
/** A document as the station tells it: what a request may leave out is always there. */
type Told<T> = T extends readonly (infer Each)[]
  ? readonly Told<Each>[]
  : T extends object
    ? { readonly [Key in keyof T]-?: Told<T[Key]> }
    : T;
export type PersonNotices = Told<Schemas['PersonNoticesView']>;
export type NoticeStation = Told<Schemas['NoticeStationView']>;

/** How people who do not look at the page are told. */
export class NoticeApi {
  readonly #http: Client<paths, 'application/json'>;

  constructor(http: Client<paths, 'application/json'>) {
    this.#http = http;
  }

  list = async () => (await told(this.#http.GET('/api/notices'))).notices;

  station = async () => (await told(this.#http.GET('/api/notices/station'))) as NoticeStation;
  saveStation = (body: Schemas['NoticeSettings']) =>
    told(this.#http.PUT('/api/notices/station', { body }));
  saveMailServer = (body: Schemas['MailServerBody']) =>
    told(this.#http.PUT('/api/notices/mail-server', { body }));
  saveHeartbeat = (url: string | null) =>
    told(this.#http.PUT('/api/notices/heartbeat', { body: { url } }));

  person = async (person: string) =>
    (await told(this.#http.GET('/api/notices/people/{person}', of({ person })))) as PersonNotices;
  savePerson = (person: string, body: Schemas['Wishes']) =>
    told(this.#http.PUT('/api/notices/people/{person}', { ...of({ person }), body }));

  addContact = (person: string, body: Schemas['ContactBody']) =>
    told(this.#http.POST('/api/notices/people/{person}/contacts', { ...of({ person }), body }));
  changeContact = (contact: string, body: Schemas['ContactPatch']) =>
    told(this.#http.PATCH('/api/notices/contacts/{contact}', { ...of({ contact }), body }));
  removeContact = (contact: string) =>
    done(this.#http.DELETE('/api/notices/contacts/{contact}', of({ contact })));
  test = (contact: string) =>
    told(this.#http.POST('/api/notices/contacts/{contact}/test', of({ contact })));
}
