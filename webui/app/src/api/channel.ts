import type { Client } from 'openapi-fetch';
import { of, told } from './call';
import type { components, paths } from './generated/station';

type Schemas = components['schemas'];

/** The catalogue of channels, and which of them a robot told or maps. */
export class ChannelApi {
  readonly #http: Client<paths, 'application/json'>;

  constructor(http: Client<paths, 'application/json'>) {
    this.#http = http;
  }

  /** Every channel that the station knows. */
  channels = () => told(this.#http.GET('/api/channels'));

  /** Add a channel of the team's own. */
  addChannel = (body: Schemas['NewChannel']) => told(this.#http.POST('/api/channels', { body }));

  changeChannel = (key: string, body: Schemas['ChannelChanges']) =>
    told(this.#http.PATCH('/api/channels/{key}', { ...of({ key }), body }));

  /** The channels of which a robot's map can be. */
  mapChoices = (robot: string) =>
    told(this.#http.GET('/api/robots/{robot}/maps/choices', of({ robot })));

  /** Let a robot's map, and its surveys, be of another channel. */
  chooseMap = (robot: string, variable: string) =>
    told(this.#http.PUT('/api/robots/{robot}/maps/choice/{variable}', of({ robot, variable })));

  /** The channels that a robot has told, and what follows of them. */
  toldChannels = (robot: string) =>
    told(this.#http.GET('/api/robots/{robot}/channels', of({ robot })));
}
