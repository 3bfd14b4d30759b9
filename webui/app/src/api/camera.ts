import type { Client } from 'openapi-fetch';
import { done, of, told, versioned } from './call';
import type { Versioned } from './client';
import type { components, paths } from './generated/station';
import type { TagSet } from './types';

type Schemas = components['schemas'];

/** Cameras over the tank, their tags and their calibrations. */
export class CameraApi {
  readonly #http: Client<paths, 'application/json'>;

  constructor(http: Client<paths, 'application/json'>) {
    this.#http = http;
  }

  list = () => told(this.#http.GET('/api/cameras'));
  add = (body: Schemas['NewCamera']) => told(this.#http.POST('/api/cameras', { body }));
  change = (camera: string, version: number, body: Schemas['CameraChanges']) =>
    told(
      this.#http.PATCH('/api/cameras/{camera}', {
        params: { path: { camera }, header: { 'if-match': `"${version}"` } },
        body,
      }),
    );
  remove = (camera: string) =>
    done(this.#http.DELETE('/api/cameras/{camera}', { params: { path: { camera } } }));
  setAccount = (camera: string, body: Schemas['CameraAccountBody']) =>
    done(this.#http.PUT('/api/cameras/{camera}/account', { ...of({ camera }), body }));
  forgetAccount = (camera: string) =>
    done(this.#http.DELETE('/api/cameras/{camera}/account', of({ camera })));

  calibrations = (camera: string) =>
    told(this.#http.GET('/api/cameras/{camera}/calibrations', of({ camera })));
  useCalibration = (camera: string, calibration: string) =>
    told(
      this.#http.POST(
        '/api/cameras/{camera}/calibrations/{calibration}/use',
        of({ camera, calibration }),
      ),
    );

  async tags(): Promise<Versioned<TagSet>> {
    return versioned(await this.#http.GET('/api/tags'));
  }

  async putTags(body: Schemas['TagsBody'], etag: string | null): Promise<Versioned<TagSet>> {
    const params = { header: etag ? { 'if-match': etag } : {} };
    return versioned(await this.#http.PUT('/api/tags', { params, body }));
  }
}
