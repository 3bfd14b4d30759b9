import type { Client } from 'openapi-fetch';
import { done, of, told } from './call';
import type { components, paths } from './generated/station';

type Schemas = components['schemas'];

/** Robots that join and leave, their links, and their deployments. */
export class SetupApi {
  readonly #http: Client<paths, 'application/json'>;

  constructor(http: Client<paths, 'application/json'>) {
    this.#http = http;
  }

  retiredRobots = () =>
    told(this.#http.GET('/api/robots', { params: { query: { retired: true } } }));
  addRobot = (body: Schemas['NewRobot']) => told(this.#http.POST('/api/robots', { body }));
  retire = (robot: string) => done(this.#http.POST('/api/robots/{robot}/retire', of({ robot })));
  restore = (robot: string) => done(this.#http.POST('/api/robots/{robot}/restore', of({ robot })));
  /** Open a link for a moment and tell what is heard there. */
  tryLink = (uri: string, system_id: number | null) =>
    told(this.#http.POST('/api/links/test', { body: { uri, system_id } }));

  vehicles = async () => (await told(this.#http.GET('/api/vehicles'))).vehicles;
  addVehicle = (body: Schemas['VehicleUpload']) => told(this.#http.POST('/api/vehicles', { body }));

  deployments = async (isVoid = false) =>
    (await told(this.#http.GET('/api/deployments', { params: { query: { void: isVoid } } })))
      .deployments;
  /** Those of a robot that somebody planned and nobody has begun. */
  plannedDeployments = async (robot: string) =>
    (
      await told(
        this.#http.GET('/api/deployments', { params: { query: { robot, state: 'planned' } } }),
      )
    ).deployments;
  deployment = (deployment: string) =>
    told(this.#http.GET('/api/deployments/{deployment}', of({ deployment })));
  /** The water as it was described when a deployment ended. */
  deploymentWater = (deployment: string) =>
    told(this.#http.GET('/api/deployments/{deployment}/water', of({ deployment })));
  /** Any robot, a retired one too. */
  robot = (robot: string) => told(this.#http.GET('/api/robots/{robot}', of({ robot })));
  deploymentTags = (robot: string, since: string | null, until: string | null) =>
    told(this.#http.GET('/api/robots/{robot}/tags', of({ robot }, { since, until })));
  deploymentMaps = (robot: string, deployment: string) =>
    told(this.#http.GET('/api/robots/{robot}/maps', of({ robot }, { deployment })));
  deploymentMap = (robot: string, variable: string, deployment: string) =>
    told(
      this.#http.GET(
        '/api/robots/{robot}/maps/{variable}',
        of({ robot, variable }, { deployment, format: 'json' as const }),
      ),
    );
  /** The newest of what was written down in a deployment, and its alarms. */
  async deploymentPast(deployment: string, limit: number) {
    const params = { query: { deployment, limit } };
    const [{ events }, { alarms }] = await Promise.all([
      told(this.#http.GET('/api/events', { params })),
      told(this.#http.GET('/api/alarms', { params })),
    ]);
    return { events, alarms };
  }
  addDeployment = (body: Schemas['NewDeployment']) =>
    told(this.#http.POST('/api/deployments', { body }));
  /** `overrule` is why it begins although a checklist is open; "" for no reason. */
  beginDeployment = (deployment: string, at: string | null, overrule: string) =>
    told(
      this.#http.POST('/api/deployments/{deployment}/begin', {
        ...of({ deployment }),
        body: { at, overrule },
      }),
    );
  endDeployment = (deployment: string, at: string | null) =>
    told(
      this.#http.POST('/api/deployments/{deployment}/end', { ...of({ deployment }), body: { at } }),
    );
  splitDeployment = (deployment: string, at: string, name: string | null) =>
    told(
      this.#http.POST('/api/deployments/{deployment}/split', {
        ...of({ deployment }),
        body: { at, name },
      }),
    );
  reviewDeployment = (deployment: string, note: string) =>
    told(
      this.#http.POST('/api/deployments/{deployment}/review', {
        ...of({ deployment }),
        body: { note },
      }),
    );
  deliverDeployment = (deployment: string, to: string) =>
    told(
      this.#http.POST('/api/deployments/{deployment}/deliver', {
        ...of({ deployment }),
        body: { to },
      }),
    );
  reopenDeployment = (deployment: string, reason: string) =>
    told(
      this.#http.POST('/api/deployments/{deployment}/reopen', {
        ...of({ deployment }),
        body: { reason },
      }),
    );
  voidDeployment = (deployment: string, reason: string) =>
    told(
      this.#http.POST('/api/deployments/{deployment}/void', {
        ...of({ deployment }),
        body: { reason },
      }),
    );
  correctDeployment = (deployment: string, body: Schemas['DeploymentChanges']) =>
    told(this.#http.PATCH('/api/deployments/{deployment}', { ...of({ deployment }), body }));
  declineSuggestion = (robot: string) =>
    done(this.#http.DELETE('/api/robots/{robot}/deployment-suggestion', of({ robot })));
  /** Let a robot be another vehicle of the catalogue. */
  setVehicle = (robot: string, model: string) =>
    done(this.#http.PATCH('/api/robots/{robot}', { ...of({ robot }), body: { model } }));
}
