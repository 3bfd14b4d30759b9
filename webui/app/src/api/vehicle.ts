import type { Client } from 'openapi-fetch';
import { of, told } from './call';
import type { paths } from './generated/station';
import type { WaypointBody } from './types';

/** Vehicles of other makers: their waypoints, and files about their parameters. */
export class VehicleApi {
  readonly #http: Client<paths, 'application/json'>;

  constructor(http: Client<paths, 'application/json'>) {
    this.#http = http;
  }

  /** Where a saved file differs from what a robot said last, or from its maker's defaults. */
  compareParameters = (robot: string, text: string, against: 'robot' | 'defaults') =>
    told(
      this.#http.POST('/api/robots/{robot}/parameters/compare', {
        params: { path: { robot }, query: { against } },
        body: { text },
      }),
    );

  describeParameters = (robot: string, text: string) =>
    told(
      this.#http.PUT('/api/robots/{robot}/parameters-description', {
        ...of({ robot }),
        body: { text },
      }),
    );

  waypoints = (robot: string) =>
    told(this.#http.GET('/api/robots/{robot}/waypoints', of({ robot })));

  putWaypoints = (robot: string, waypoints: WaypointBody[]) =>
    told(
      this.#http.PUT('/api/robots/{robot}/waypoints', { ...of({ robot }), body: { waypoints } }),
    );

  readWaypoints = (robot: string) =>
    told(this.#http.POST('/api/robots/{robot}/waypoints/read', of({ robot })));
}
