import type { Client } from 'openapi-fetch';
import { done, of, told, versioned } from './call';
import type { Versioned } from './client';
import type { components, paths } from './generated/station';
import type { TagSet } from './types';

type Schemas = components['schemas'];

export type LensKind = NonNullable<Schemas['LensOrder']['kind']>;

/** Cameras over the tank, their tags and their calibrations. */
export class CameraApi {
  readonly #http: Client<paths, 'application/json'>;

  constructor(http: Client<paths, 'application/json'>) {
    this.#http = http;
  }

  list = () => told(this.#http.GET('/api/cameras'));
  add = (body: Schemas['NewCamera']) => told(this.#http.POST('/api/cameras', { body }));
  /** Look through a camera that is none of the station's yet. */
  lookThrough = (body: Schemas['CameraTrialRequest']) =>
    told(this.#http.POST('/api/cameras/test', { body }));
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

  boards = (camera: string) => told(this.#http.GET('/api/cameras/{camera}/boards', of({ camera })));
  takeBoard = (camera: string, kind: LensKind) =>
    told(this.#http.POST('/api/cameras/{camera}/boards', { ...of({ camera }), body: { kind } }));
  /** Forget one picture of the board, or all. */
  forgetBoards = (camera: string, number: number | null = null) =>
    told(this.#http.DELETE('/api/cameras/{camera}/boards', of({ camera }, { number: number })));
  calibrateLens = (camera: string, kind: LensKind) =>
    told(this.#http.POST('/api/cameras/{camera}/lens', { ...of({ camera }), body: { kind } }));

  /** The cameras that robots are found by, and the water that they look into. */
  rig = () => told(this.#http.GET('/api/camera-rig'));
  adjust = (body: Schemas['AdjustOrder']) => told(this.#http.POST('/api/cameras/adjust', { body }));
  measureAccuracy = () => told(this.#http.POST('/api/camera-rig/accuracy'));

  /** What the page that a camera looks at is to show. */
  latencyCheck = (camera: string) =>
    told(this.#http.GET('/api/cameras/{camera}/latency', of({ camera })));
  checkLatency = (camera: string) =>
    told(this.#http.POST('/api/cameras/{camera}/latency', of({ camera })));

  keptPictures = () => told(this.#http.GET('/api/camera-pictures'));
  keepPictures = (body: Schemas['KeepOrder']) =>
    told(this.#http.POST('/api/camera-pictures', { body }));
  stopKeeping = () => told(this.#http.DELETE('/api/camera-pictures'));
  deletePictures = (deployment: string) =>
    told(this.#http.DELETE('/api/camera-pictures/{deployment}', of({ deployment })));

  /** Where cameras found a robot from a moment on, the refused ones too. */
  fixes = (robot: string, query: { start: string }) =>
    told(this.#http.GET('/api/robots/{robot}/fixes', of({ robot }, query)));

  async tags(): Promise<Versioned<TagSet>> {
    return versioned(await this.#http.GET('/api/tags'));
  }

  async putTags(body: Schemas['TagsBody'], etag: string | null): Promise<Versioned<TagSet>> {
    const params = { header: etag ? { 'if-match': etag } : {} };
    return versioned(await this.#http.PUT('/api/tags', { params, body }));
  }
}
