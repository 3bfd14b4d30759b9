import type { Client } from 'openapi-fetch';
import type { components, paths } from './generated/station';
import { done, of, told } from './call';

/** What leaves the station of a deployment as science. */
export class DeliveryApi {
  readonly #http: Client<paths, 'application/json'>;

  constructor(http: Client<paths, 'application/json'>) {
    this.#http = http;
  }

  quality = (deployment: string) =>
    told(this.#http.GET('/api/deployments/{deployment}/quality', of({ deployment })));
  checkQuality = (deployment: string) =>
    told(this.#http.POST('/api/deployments/{deployment}/quality', of({ deployment })));
  setFlag = (deployment: string, body: components['schemas']['NewFlag']) =>
    told(this.#http.POST('/api/deployments/{deployment}/flags', { ...of({ deployment }), body }));
  withdrawFlag = (deployment: string, flag: string) =>
    done(this.#http.DELETE('/api/deployments/{deployment}/flags/{flag}', of({ deployment, flag })));

  files = (deployment: string) =>
    told(this.#http.GET('/api/deployments/{deployment}/files', of({ deployment })));
  writeFile = (deployment: string, noBetterData: boolean) =>
    told(
      this.#http.POST('/api/deployments/{deployment}/files', {
        ...of({ deployment }),
        body: { no_better_data: noBetterData },
      }),
    );

  delivery = (deployment: string) =>
    told(this.#http.GET('/api/deployments/{deployment}/delivery', of({ deployment })));
  deliver = (deployment: string, body: components['schemas']['NewPackage']) =>
    told(
      this.#http.POST('/api/deployments/{deployment}/delivery', { ...of({ deployment }), body }),
    );
}

/** Where a file that was written is fetched from. */
export function filePath(deployment: string, file: string): string {
  return `/api/deployments/${encodeURIComponent(deployment)}/files/${encodeURIComponent(file)}`;
}

/** Where a delivery that was packed is fetched from. */
export function packagePath(deployment: string, id: string): string {
  return `/api/deployments/${encodeURIComponent(deployment)}/delivery/${encodeURIComponent(id)}`;
}
