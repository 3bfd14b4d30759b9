import { LinkApi } from './link_client';
import { at, listed, part, Road, type Call, type Listed, type Query } from './road';
import type {
  Alarm,
  Command,
  CommandKind,
  ConfigDocument,
  ConfigKind,
  ControllerWish,
  Deployment,
  EventPage,
  FieldMap,
  Health,
  Identification,
  IdentificationListing,
  Job,
  JsonObject,
  MapComparison,
  MapListing,
  Mission,
  NewToken,
  Person,
  Plan,
  PlanListing,
  PlanState,
  Polar,
  Robot,
  RobotState,
  Role,
  RouteChoice,
  Samples,
  SceneChange,
  SceneView,
  Session,
  SteadyMotion,
  Token,
  Track,
  TrackPage,
  TrimAccepted,
  WhatIf,
  WhatIfListing,
} from './types';

export interface SendWish {
  route?: RouteChoice;
  /** Send also one that the robot has meanwhile moved away from. */
  confirmed?: boolean;
  /** Send also to a robot that was not heard for too long. */
  force?: boolean;
}

export interface Versioned<T> {
  value: T;
  etag: string | null;
}

/** The station's REST interface, one method a resource; every refusal is thrown as a Problem. */
export class Api {
  readonly #road = new Road();
  /** Links, satellite messages, gateways, parameters and logs. */
  readonly link = new LinkApi(this.#road);

  /** Called when the station no longer knows this browser. */
  set onSignedOut(act: () => void) {
    this.#road.onSignedOut = act;
  }

  health = () => this.#json<Health>('GET', '/api/health');

  async session(): Promise<Session> {
    return this.#remember(await this.#json<Session>('GET', '/api/session'));
  }

  async signIn(name: string, password: string): Promise<void> {
    await this.#send('POST', '/api/session', { body: { name, password } });
  }

  async createFirstPerson(name: string, password: string, code: string): Promise<void> {
    await this.#send('POST', '/api/session/first', { body: { name, password, code } });
  }

  async signOut(): Promise<void> {
    await this.#send('DELETE', '/api/session');
  }

  robots = () => this.#json<Robot[]>('GET', '/api/robots');
  /** Let a robot be another vehicle of the catalogue. */
  setVehicle = (robot: string, key: string) =>
    this.#send('PATCH', at(robot), { body: { model: key } });

  state = (robot: string) => this.#json<RobotState>('GET', `${at(robot)}/state`);

  samples = (robot: string, query: Query, signal?: AbortSignal) =>
    this.#json<Samples>('GET', `${at(robot)}/samples`, { query, signal });

  track = (robot: string, query: Query, signal?: AbortSignal) =>
    this.#json<Track>('GET', `${at(robot)}/track`, { query, signal });

  command = (robot: string, kind: CommandKind) =>
    this.#json<{ id: string }>('POST', `${at(robot)}/commands`, { body: { kind } });

  commands = (robot: string, limit: number) =>
    this.#json<Command[]>('GET', `${at(robot)}/commands`, { query: { limit } });

  commandState = (id: string) => this.#json<Command>('GET', `/api/commands/${part(id)}`);

  /** Begin a mission; nothing is sent before it is started. */
  createMission = (robot: string, kind: string, config: JsonObject) =>
    this.#json<{ id: string }>('POST', `${at(robot)}/missions`, { body: { kind, config } });

  /** Missions of a robot, the newest first. */
  missions = (robot: string) => this.#json<Mission[]>('GET', `${at(robot)}/missions`);

  mission = (id: string) => this.#json<Mission>('GET', `/api/missions/${part(id)}`);
  startMission = (id: string) => this.#send('POST', `/api/missions/${part(id)}/start`);
  stopMission = (id: string) => this.#send('POST', `/api/missions/${part(id)}/stop`);

  /** Begin surveys of several robots of one site, planned one after the other. */
  /** Plan a survey of several robots; each plan waits until somebody sends it. */
  createSurvey = (robots: readonly string[], config: JsonObject) =>
    this.#json<{ missions: { robot: string; mission: string }[] }>('POST', '/api/surveys', {
      body: { robots, config, automation: false },
    });

  /** Plans of a robot in one state, the newest first. */
  plans = (robot: string, state: PlanState) =>
    this.#json<PlanListing[]>('GET', `${at(robot)}/plans`, { query: { state } });

  plan = (id: string) => this.#json<Plan>('GET', `/api/plans/${part(id)}`);
  cancelPlan = (id: string) => this.#send('POST', `/api/plans/${part(id)}/cancel`);

  /** Let a runner-up take the draft's place. */
  chooseRunnerUp = (id: string, runnerUp: number) =>
    this.#json<{ id: string }>('POST', `/api/plans/${part(id)}/choose`, {
      body: { runner_up: runnerUp },
    });

  /** Search on from a draft and its runners-up. */
  searchOn = (id: string, planning_time_s: number | null) =>
    this.#json<{ id: string }>('POST', `/api/plans/${part(id)}/continue`, {
      body: planning_time_s === null ? {} : { planning_time_s },
    });

  /** Make a plan of a kind that takes no search; nothing is sent. */
  createPlan = (robot: string, kind: string, config: JsonObject) =>
    this.#json<{ id: string }>('POST', `${at(robot)}/plans`, { body: { kind, config } });

  /** What a robot said of its hold on a target, the oldest first. */
  tracking = (robot: string, query: Query, signal?: AbortSignal) =>
    this.#json<TrackPage>('GET', `${at(robot)}/tracking`, { query, signal });

  /** Send a plan. */
  uploadPlan = (id: string, wish: SendWish = {}) =>
    this.#json<{ transfer: string }>('POST', `/api/plans/${part(id)}/upload`, {
      body: { start: true, ...wish },
    });

  maps = (robot: string) => this.#json<MapListing[]>('GET', `${at(robot)}/maps`);

  map = (robot: string, variable: string, model: string, signal?: AbortSignal) =>
    this.#json<FieldMap>('GET', `${at(robot)}/maps/${part(variable)}`, {
      query: { model, format: 'json' },
      signal,
    });

  comparison = (robot: string, variable: string, signal?: AbortSignal) =>
    this.#json<MapComparison>('GET', `${at(robot)}/maps/${part(variable)}/comparison`, { signal });

  compareModels = (robot: string, variable: string) =>
    this.#json<{ job: string }>('POST', `${at(robot)}/maps/${part(variable)}/comparison`);

  learnKernels = (robot: string, variable: string) =>
    this.#json<{ job: string }>('POST', `${at(robot)}/maps/${part(variable)}/learning`);

  sceneView = (robot: string, signal?: AbortSignal) =>
    this.#json<SceneView>('GET', `${at(robot)}/view`, { signal });

  changeSceneView = (robot: string, change: SceneChange) =>
    this.#json<SceneView>('PATCH', `${at(robot)}/view`, { body: change });

  configKinds = () => this.#json<ConfigKind[]>('GET', '/api/config');

  configSchema = (kind: string) =>
    this.#json<JsonObject>('GET', `/api/config/${part(kind)}/schema`);

  async config(kind: string, robot: string): Promise<Versioned<ConfigDocument>> {
    const response = await this.#send('GET', `/api/config/${part(kind)}`, { query: { robot } });
    return versioned<ConfigDocument>(response);
  }

  async changeConfig(
    kind: string,
    robot: string,
    change: JsonObject,
    etag: string | null,
  ): Promise<Versioned<ConfigDocument>> {
    const response = await this.#send('PATCH', `/api/config/${part(kind)}`, {
      query: { robot },
      body: change,
      headers: etag === null ? {} : { 'If-Match': etag },
    });
    return versioned<ConfigDocument>(response);
  }

  /** Motion and energy of the planner, worked out from the vehicle's polar. */
  capability = (vehicle: string) =>
    this.#json<{ primitives: JsonObject; energy: JsonObject; message?: string }>(
      'GET',
      `${vehicleAt(vehicle)}/capability`,
    );

  polar = (vehicle: string, signal?: AbortSignal) =>
    this.#json<Polar>('GET', `${vehicleAt(vehicle)}/polar`, { signal });

  steady = (vehicle: string, inputs: { m0_kg: number; rp1_m: number; delta_rad: number }) =>
    this.#json<SteadyMotion>('GET', `${vehicleAt(vehicle)}/steady`, { query: inputs });

  startWhatIf = (robot: string, scenario: JsonObject, controllers: ControllerWish[]) =>
    this.#json<{ id: string; job: string }>('POST', `${at(robot)}/whatif`, {
      body: { scenario, controllers },
    });

  async whatIfs(robot: string): Promise<WhatIfListing[]> {
    return listed(await this.#json<Listed<WhatIfListing>>('GET', `${at(robot)}/whatifs`));
  }

  whatIf = (id: string) => this.#json<WhatIf>('GET', `/api/whatifs/${part(id)}`);

  showWhatIf = (robot: string, id: string | null) =>
    this.#send('PUT', `${at(robot)}/whatif/shown`, { body: { id } });

  startIdentification = (
    robot: string,
    wish: { deployment: string; start?: string; end?: string; config: JsonObject },
  ) =>
    this.#json<{ id: string; job: string }>('POST', `${at(robot)}/identifications`, {
      body: wish,
    });

  async identifications(robot: string): Promise<IdentificationListing[]> {
    return listed(
      await this.#json<Listed<IdentificationListing>>('GET', `${at(robot)}/identifications`),
    );
  }

  identification = (id: string, signal?: AbortSignal) =>
    this.#json<Identification>('GET', identificationAt(id), { signal });

  cancelIdentification = (id: string) => this.#send('POST', `${identificationAt(id)}/cancel`);
  resumeIdentification = (id: string) => this.#send('POST', `${identificationAt(id)}/resume`);

  acceptIdentification = (id: string, vehicle: { key?: string; title?: string }) =>
    this.#json<{ vehicle: string; trim_message?: string }>(
      'POST',
      `${identificationAt(id)}/accept`,
      { body: vehicle },
    );

  askTrimAdvice = (robot: string, wish: { deployment?: string; dives?: number }) =>
    this.#json<{ job: string }>('POST', `${at(robot)}/trim/advice`, { body: wish });

  acceptTrim = (robot: string, advice: string, share: 0.5 | 1) =>
    this.#json<TrimAccepted>('POST', `${at(robot)}/trim/accept`, { body: { advice, share } });

  events = (query: Query) => this.#json<EventPage>('GET', '/api/events', { query });
  async alarms(state: 'open' | 'closed' = 'open'): Promise<Alarm[]> {
    const query = { state };
    return (await this.#json<{ alarms: Alarm[] }>('GET', '/api/alarms', { query })).alarms;
  }

  acknowledge = (id: string) => this.#send('POST', `/api/alarms/${part(id)}/ack`);

  async deployments(): Promise<Deployment[]> {
    return (await this.#json<{ deployments: Deployment[] }>('GET', '/api/deployments')).deployments;
  }

  importFile(file: File, robot: string, policy: 'skip' | 'refuse'): Promise<{ id: string }> {
    const form = new FormData();
    form.set('file', file);
    form.set('robot', robot);
    form.set('policy', policy);
    return this.#json<{ id: string }>('POST', '/api/imports', { form });
  }

  job = (id: string) => this.#json<Job>('GET', `/api/jobs/${part(id)}`);
  cancelJob = (id: string) => this.#send('DELETE', `/api/jobs/${part(id)}`);

  async people(): Promise<Person[]> {
    return (await this.#json<{ people: Person[] }>('GET', '/api/people')).people;
  }

  addPerson = (person: { name: string; role: Role; password: string }) =>
    this.#json<Person>('POST', '/api/people', { body: person });

  changePerson = (name: string, change: { role?: Role; disabled?: boolean }) =>
    this.#json<Person>('PATCH', `/api/people/${part(name)}`, { body: change });

  async tokens(): Promise<Token[]> {
    return (await this.#json<{ tokens: Token[] }>('GET', '/api/tokens')).tokens;
  }

  createToken = (token: { name: string; role: Role; days: number }) =>
    this.#json<NewToken>('POST', '/api/tokens', { body: token });

  revokeToken = (id: string) => this.#send('DELETE', `/api/tokens/${part(id)}`);

  #remember(session: Session): Session {
    this.#road.csrf = session.csrf_token ?? '';
    return session;
  }

  #json = <T>(method: string, path: string, call: Call = {}): Promise<T> =>
    this.#road.json<T>(method, path, call);

  #send = (method: string, path: string, call: Call = {}): Promise<Response> =>
    this.#road.send(method, path, call);
}

async function versioned<T>(response: Response): Promise<Versioned<T>> {
  return { value: (await response.json()) as T, etag: response.headers.get('ETag') };
}

function vehicleAt(key: string): string {
  return `/api/vehicles/${part(key)}`;
}

function identificationAt(id: string): string {
  return `/api/identifications/${part(id)}`;
}
