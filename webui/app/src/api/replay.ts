import type { Client } from 'openapi-fetch';
import { of, told } from './call';
import type { components, paths } from './generated/station';

type Clock = 'measured' | 'received';
export type Film = components['schemas']['FilmView'];
export type FilmWish = components['schemas']['NewFilm'];

/** What was known of robots at moments of the past. */
export class ReplayApi {
  readonly #http: Client<paths, 'application/json'>;

  constructor(http: Client<paths, 'application/json'>) {
    this.#http = http;
  }

  /** Everything that was known of a robot at a moment. */
  moment = (robot: string, at: string, clock: Clock) =>
    told(this.#http.GET('/api/robots/{robot}/moment', of({ robot }, { at, clock })));

  /** The deployment of a moment from end to end, with what happened in it. */
  timeline = (robot: string, at: string) =>
    told(this.#http.GET('/api/robots/{robot}/timeline', of({ robot }, { at })));

  /** Stretches of the past that were made files. */
  films = (robot: string) => told(this.#http.GET('/api/robots/{robot}/films', of({ robot })));
  makeFilm = (robot: string, body: FilmWish) =>
    told(this.#http.POST('/api/robots/{robot}/films', { ...of({ robot }), body }));

  /** Draw the 3D view of a tab at a moment. */
  moveView = (robot: string, tab: string, at: string, clock: Clock) =>
    told(
      this.#http.PUT('/api/robots/{robot}/view/replay/{tab}', {
        ...of({ robot, tab }),
        body: { at, clock },
      }),
    );
}
