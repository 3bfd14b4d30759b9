import type { Client } from 'openapi-fetch';
import { of, told } from './call';
import type { paths } from './generated/station';

/** Tags of fish, as robots hear them. */
export class TagApi {
  readonly #http: Client<paths, 'application/json'>;

  constructor(http: Client<paths, 'application/json'>) {
    this.#http = http;
  }

  tags = (robot: string) => told(this.#http.GET('/api/robots/{robot}/tags', of({ robot })));

  detections = (robot: string, query: { limit: number; tag?: string | null }) =>
    told(this.#http.GET('/api/robots/{robot}/detections', { params: { path: { robot }, query } }));

  tagTrack = (robot: string, query: { tag?: string | null }) =>
    told(this.#http.GET('/api/robots/{robot}/tags/track', { params: { path: { robot }, query } }));

  resting = (robot: string, tag: string) =>
    told(this.#http.GET('/api/robots/{robot}/tags/{tag}/resting', of({ robot, tag })));

  importDetections(robot: string, file: File): Promise<{ id: string }> {
    const form = new FormData();
    form.set('file', file);
    const asked = { ...of({ robot }), body: { file: file.name }, bodySerializer: () => form };
    return told(this.#http.POST('/api/robots/{robot}/detections', asked));
  }
}
