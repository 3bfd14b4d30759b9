import createClient, { type Client } from 'openapi-fetch';
import type { components, paths } from './generated/station';
import { AccessApi } from './access';
import { done, newKey, of, told, versioned } from './call';
import { AlarmApi } from './alarm';
import { ChannelApi } from './channel';
import { ChecklistApi } from './checklist';
import { DecisionApi } from './decision';
import { DemoApi } from './demo';
import { DesignApi } from './design';
import { LeaseApi } from './lease';
import { LogBookApi } from './log_book';
import { noAnswer, Problem, problemOf } from './problem';
import { SetupApi } from './setup';
import { ReplayApi } from './replay';
import type { ConfigDocument, JsonObject, SceneChange, ScheduleWish, SendWish } from './types';
import { OutlookApi } from './outlook';
import { WaterApi } from './water';

type Schemas = components['schemas'];
type Query<Path extends keyof paths> = NonNullable<
  paths[Path] extends { get: { parameters: { query?: infer Q } } } ? Q : never
>;

export interface Versioned<T> {
  value: T;
  etag: string | null;
}

/** The station's REST interface, one method a resource; every refusal is thrown as a Problem. */
export class Api {
  /** Called when the station no longer knows this browser. */
  onSignedOut: () => void = () => undefined;
  /** Returns why a request that changes something must not leave this page; empty where it may. */
  refuse: (request: Request) => string | Promise<string> = () => '';
  /** Proves to the station that a request comes from its own page. */
  csrf = '';
  readonly #http = createClient<paths, 'application/json'>({
    headers: { Accept: 'application/json' },
  });

  constructor() {
    this.#http.use({
      onRequest: async ({ request }) => {
        if (request.method === 'GET') return;
        const refusal = await this.refuse(request);
        if (refusal !== '') throw new Problem(409, 'Not sent', refusal);
        request.headers.set('X-CSRF-Token', this.csrf);
        if (request.method !== 'POST' || request.headers.has('Idempotency-Key')) return;
        request.headers.set('Idempotency-Key', newKey());
      },
      onResponse: async ({ response, schemaPath }) => {
        if (response.ok || schemaPath === '/api/health') return;
        if (response.status === 401 && schemaPath !== '/api/session') this.onSignedOut();
        throw await problemOf(response);
      },
      onError: ({ error }) =>
        error instanceof DOMException && error.name === 'AbortError' ? undefined : noAnswer(),
    });
  }

  /** Tells how the station is, which says so itself while it can take no work. */
  async health(): Promise<Schemas['HealthView']> {
    const { data, error, response } = await this.#http.GET('/api/health');
    if (data !== undefined) return data;
    if (response.status === 503 && typeof error === 'object' && 'ready' in error) return error;
    throw await problemOf(response);
  }

  async session(): Promise<Schemas['SessionView']> {
    const session = await told(this.#http.GET('/api/session'));
    this.csrf = session.csrf_token ?? '';
    return session;
  }

  signIn = (name: string, password: string) =>
    done(this.#http.POST('/api/session', { body: { name, password } }));

  openLink = (link: string) => done(this.#http.POST('/api/session', { body: { link } }));

  createFirstPerson = (name: string, password: string, code: string) =>
    done(this.#http.POST('/api/session/first', { body: { name, password, code } }));

  signOut = () => done(this.#http.DELETE('/api/session'));

  robots = () => told(this.#http.GET('/api/robots'));
  readonly replay = new ReplayApi(this.#http);
  /** Robots that join and leave, their links, and their deployments. */
  readonly setup = new SetupApi(this.#http);
  readonly decisions = new DecisionApi(this.#http);
  readonly lease = new LeaseApi(this.#http);
  readonly demo = new DemoApi(this.#http);
  readonly checklist = new ChecklistApi(this.#http);
  readonly access = new AccessApi(this.#http);
  readonly design = new DesignApi(this.#http);
  readonly channel = new ChannelApi(this.#http);
  readonly alarm = new AlarmApi(this.#http);
  readonly water = new WaterApi(this.#http);
  readonly outlook = new OutlookApi(this.#http);
  readonly logBook = new LogBookApi(this.#http, () => this.csrf);

  /** Routes that few pages call, and that they bring along. */
  part = <T>(Part: new (http: Client<paths, 'application/json'>) => T): T => new Part(this.#http);

  samples = (robot: string, query: Query<'/api/robots/{robot}/samples'>, signal?: AbortSignal) =>
    told(this.#http.GET('/api/robots/{robot}/samples', of({ robot }, query, signal)));

  track = (robot: string, query: Query<'/api/robots/{robot}/track'>, signal?: AbortSignal) =>
    told(this.#http.GET('/api/robots/{robot}/track', of({ robot }, query, signal)));

  /** What a robot said of its hold on a target, the oldest first. */
  tracking = (robot: string, query: Query<'/api/robots/{robot}/tracking'>, signal?: AbortSignal) =>
    told(this.#http.GET('/api/robots/{robot}/tracking', of({ robot }, query, signal)));

  command = (robot: string, kind: Schemas['CommandRequest']['kind']) =>
    told(this.#http.POST('/api/robots/{robot}/commands', { ...of({ robot }), body: { kind } }));

  commands = (robot: string, limit: number) =>
    told(this.#http.GET('/api/robots/{robot}/commands', of({ robot }, { limit })));

  commandState = (command: string) =>
    told(this.#http.GET('/api/commands/{command}', of({ command })));

  links = (robot: string) => told(this.#http.GET('/api/robots/{robot}/links', of({ robot })));

  /** Let the station use a link, or let it alone until it is plugged in again. */
  plug = (robot: string, uri: string, plugged: boolean) =>
    told(
      this.#http.POST('/api/robots/{robot}/links/plug', {
        ...of({ robot }),
        body: { uri, plugged },
      }),
    );

  satelliteLog = (robot: string) =>
    told(this.#http.GET('/api/robots/{robot}/satellite', of({ robot })));

  parameters = (robot: string, against = '') =>
    told(
      this.#http.GET('/api/robots/{robot}/parameters', {
        params: { path: { robot }, query: against ? { against } : {} },
      }),
    );

  readParameters = (robot: string) =>
    told(this.#http.POST('/api/robots/{robot}/parameters/read', of({ robot })));

  /** Write one and read it back; the answer is what the robot has now. */
  writeParameter = (robot: string, name: string, value: number) =>
    told(
      this.#http.PUT('/api/robots/{robot}/parameters/{name}', {
        ...of({ robot, name }),
        body: { value },
      }),
    );

  logs = (robot: string) => told(this.#http.GET('/api/robots/{robot}/logs', of({ robot })));

  readLogs = (robot: string) =>
    told(this.#http.POST('/api/robots/{robot}/logs/read', of({ robot })));

  downloadLog = (robot: string, path: string) =>
    told(
      this.#http.POST('/api/robots/{robot}/logs/download', { ...of({ robot }), body: { path } }),
    );

  /** Begin a mission; nothing is sent before it is started. */
  createMission = (robot: string, kind: 'adaptive_survey', config: JsonObject) =>
    told(
      this.#http.POST('/api/robots/{robot}/missions', { ...of({ robot }), body: { kind, config } }),
    );

  /** Missions of a robot, the newest first. */
  missions = (robot: string) => told(this.#http.GET('/api/robots/{robot}/missions', of({ robot })));

  mission = (mission: string) => told(this.#http.GET('/api/missions/{mission}', of({ mission })));

  startMission = (mission: string) =>
    done(this.#http.POST('/api/missions/{mission}/start', of({ mission })));

  stopMission = (mission: string) =>
    done(this.#http.POST('/api/missions/{mission}/stop', of({ mission })));

  /** Plan surveys of several robots of one site, one after the other; nothing is sent. */
  createSurvey = (robots: string[], config: JsonObject) =>
    told(this.#http.POST('/api/surveys', { body: { robots, config, automation: false } }));

  /** Plans of a robot in one state, the newest first. */
  plans = (robot: string, state: Schemas['PlanView']['state']) =>
    told(this.#http.GET('/api/robots/{robot}/plans', of({ robot }, { state })));

  plan = (plan: string) => told(this.#http.GET('/api/plans/{plan}', of({ plan })));

  cancelPlan = (plan: string) => done(this.#http.POST('/api/plans/{plan}/cancel', of({ plan })));

  /** Let a runner-up take the draft's place. */
  chooseRunnerUp = (plan: string, runner_up: number) =>
    told(this.#http.POST('/api/plans/{plan}/choose', { ...of({ plan }), body: { runner_up } }));

  /** Fly a draft ahead again, however long that takes. */
  rehearse = (plan: string) => told(this.#http.POST('/api/plans/{plan}/rehearse', of({ plan })));

  /** Search on from a draft and its runners-up. */
  searchOn = (plan: string, planning_time_s: number | null) =>
    told(
      this.#http.POST('/api/plans/{plan}/continue', { ...of({ plan }), body: { planning_time_s } }),
    );

  /** Search for the draft of a survey anew, from where the robot is now. */
  planAgain = (robot: string, mission: string) =>
    told(
      this.#http.POST('/api/robots/{robot}/plans', {
        ...of({ robot }),
        body: { kind: 'adaptive_survey', mission },
      }),
    );

  /** Make a plan that follows a target, which takes no search; nothing is sent. */
  /** A survey of one round by settings that hold for this plan alone. */
  planSurvey = (robot: string, config: JsonObject) =>
    told(
      this.#http.POST('/api/robots/{robot}/plans', {
        ...of({ robot }),
        body: { kind: 'adaptive_survey', config, keep_settings: false },
      }),
    );

  createPlan = (robot: string, kind: 'track_target', config: JsonObject) =>
    told(
      this.#http.POST('/api/robots/{robot}/plans', { ...of({ robot }), body: { kind, config } }),
    );

  /** Send a plan. */
  uploadPlan = (plan: string, wish: SendWish = {}) =>
    told(
      this.#http.POST('/api/plans/{plan}/upload', {
        ...of({ plan }),
        body: { start: true, ...wish },
      }),
    );

  /** What sending a plan by satellite would take; nothing is sent. */
  quote = (plan: string) => told(this.#http.GET('/api/plans/{plan}/satellite', of({ plan })));

  /** What waits at the station to be sent to a robot. */
  schedule = (robot: string) => told(this.#http.GET('/api/robots/{robot}/schedule', of({ robot })));

  /** Have a plan sent by itself; nothing is sent before its condition is true. */
  scheduleSend = (plan: string, wish: ScheduleWish) =>
    told(this.#http.POST('/api/plans/{plan}/schedule', { ...of({ plan }), body: wish }));

  cancelScheduled = (id: string) =>
    told(this.#http.POST('/api/schedule/{schedule_id}/cancel', of({ schedule_id: id })));

  withdraw = (transfer: string) =>
    done(this.#http.POST('/api/transfers/{transfer}/withdraw', of({ transfer })));

  /** @param at As they had been kept by then; of now where it is `null`. */
  maps = (robot: string, at: string | null = null) =>
    told(this.#http.GET('/api/robots/{robot}/maps', of({ robot }, { at })));

  map = (robot: string, variable: string, model: string, at: string | null = null) =>
    told(
      this.#http.GET(
        '/api/robots/{robot}/maps/{variable}',
        of({ robot, variable }, { model, format: 'json' as const, at }),
      ),
    );

  shareAbove = (robot: string, variable: string, above: number) =>
    told(
      this.#http.GET(
        '/api/robots/{robot}/maps/{variable}/share',
        of({ robot, variable }, { above }),
      ),
    );

  current = (robot: string) => told(this.#http.GET('/api/robots/{robot}/current', of({ robot })));

  currentWorth = (robot: string, typed: Query<'/api/robots/{robot}/current/worth'>) =>
    told(this.#http.GET('/api/robots/{robot}/current/worth', of({ robot }, typed)));

  flow = (robot: string, query: Query<'/api/robots/{robot}/current/flow'>) =>
    told(this.#http.GET('/api/robots/{robot}/current/flow', of({ robot }, query)));

  comparison = (robot: string, variable: string) =>
    told(this.#http.GET('/api/robots/{robot}/maps/{variable}/comparison', of({ robot, variable })));

  compareModels = (robot: string, variable: string) =>
    told(
      this.#http.POST('/api/robots/{robot}/maps/{variable}/comparison', of({ robot, variable })),
    );

  learnKernels = (robot: string, variable: string) =>
    told(this.#http.POST('/api/robots/{robot}/maps/{variable}/learning', of({ robot, variable })));

  sceneView = (robot: string, signal?: AbortSignal) =>
    told(this.#http.GET('/api/robots/{robot}/view', of({ robot }, undefined, signal)));

  changeSceneView = (robot: string, body: SceneChange) =>
    told(this.#http.PATCH('/api/robots/{robot}/view', { ...of({ robot }), body }));

  configKinds = () => told(this.#http.GET('/api/config'));

  configSchema = (kind: string) => told(this.#http.GET('/api/config/{kind}/schema', of({ kind })));

  async config(kind: string, robot: string): Promise<Versioned<ConfigDocument>> {
    return versioned(await this.#http.GET('/api/config/{kind}', of({ kind }, { robot })));
  }

  async changeConfig(
    kind: string,
    robot: string,
    body: JsonObject,
    etag: string | null,
  ): Promise<Versioned<ConfigDocument>> {
    const params = { path: { kind }, query: { robot }, header: etag ? { 'if-match': etag } : {} };
    return versioned(await this.#http.PATCH('/api/config/{kind}', { params, body }));
  }

  /** Motion and energy of the planner, worked out from the vehicle's polar. */
  capability = (key: string) => told(this.#http.GET('/api/vehicles/{key}/capability', of({ key })));

  polar = (key: string, signal?: AbortSignal) =>
    told(this.#http.GET('/api/vehicles/{key}/polar', of({ key }, undefined, signal)));

  steady = (key: string, inputs: Query<'/api/vehicles/{key}/steady'>) =>
    told(this.#http.GET('/api/vehicles/{key}/steady', of({ key }, inputs)));

  startWhatIf = (robot: string, scenario: JsonObject, controllers: Schemas['ControllerBody'][]) =>
    told(
      this.#http.POST('/api/robots/{robot}/whatif', {
        ...of({ robot }),
        body: { scenario, controllers },
      }),
    );

  whatIfs = async (robot: string) =>
    (await told(this.#http.GET('/api/robots/{robot}/whatifs', of({ robot })))).whatifs;

  whatIf = (whatif: string) => told(this.#http.GET('/api/whatifs/{whatif}', of({ whatif })));

  showWhatIf = (robot: string, id: string | null) =>
    done(this.#http.PUT('/api/robots/{robot}/whatif/shown', { ...of({ robot }), body: { id } }));

  startIdentification = (robot: string, body: Schemas['IdentificationRequest']) =>
    told(this.#http.POST('/api/robots/{robot}/identifications', { ...of({ robot }), body }));

  identifications = async (robot: string) =>
    (await told(this.#http.GET('/api/robots/{robot}/identifications', of({ robot }))))
      .identifications;

  identification = (identification: string) =>
    told(this.#http.GET('/api/identifications/{identification}', of({ identification })));

  cancelIdentification = (identification: string) =>
    done(this.#http.POST('/api/identifications/{identification}/cancel', of({ identification })));

  resumeIdentification = (identification: string) =>
    done(this.#http.POST('/api/identifications/{identification}/resume', of({ identification })));

  acceptIdentification = (identification: string, body: Schemas['AcceptRequest']) =>
    told(
      this.#http.POST('/api/identifications/{identification}/accept', {
        ...of({ identification }),
        body,
      }),
    );

  askTrimAdvice = (robot: string, body: Schemas['AdviceRequest']) =>
    told(this.#http.POST('/api/robots/{robot}/trim/advice', { ...of({ robot }), body }));

  acceptTrim = (robot: string, advice: string, share: 0.5 | 1) =>
    told(
      this.#http.POST('/api/robots/{robot}/trim/accept', {
        ...of({ robot }),
        body: { advice, share },
      }),
    );

  gateways = async () => (await told(this.#http.GET('/api/gateways'))).gateways;

  changeGateway = (kind: Schemas['GatewayView']['kind'], body: Schemas['AccountBody']) =>
    done(this.#http.PUT('/api/gateways/{kind}', { ...of({ kind }), body }));

  actors = () => told(this.#http.GET('/api/events/actors'));
  events = (query: Query<'/api/events'>) =>
    told(this.#http.GET('/api/events', { params: { query } }));

  deployments = () => this.setup.deployments();

  job = (job: string) => told(this.#http.GET('/api/jobs/{job}', of({ job })));
  cancelJob = (job: string) => done(this.#http.DELETE('/api/jobs/{job}', of({ job })));
}
