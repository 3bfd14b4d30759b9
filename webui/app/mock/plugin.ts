import type { IncomingMessage, Server, ServerResponse } from 'node:http';
import type { Plugin } from 'vite';
import { WebSocketServer } from 'ws';
import type { JsonObject } from '../src/api/types';
import type { FakePursuitPlan } from './pursuit_plan';
import { iso } from './robot';
import { SCENE } from './scene';
import { KINDS } from './schema';
import { FakeStation } from './station';
import type { FakeFlight } from './transfer';

const TICK_MS = 100;
const POLICY = "default-src 'self'; frame-ancestors 'none'; base-uri 'none'; object-src 'none'";

type Answer = { status?: number; body?: unknown; headers?: Record<string, string> } | null;

/** Answers the station's addresses during development; shapes as in src/api/types.ts. */
export function mockStation(): Plugin {
  const station = new FakeStation();
  const handle = (request: IncomingMessage, response: ServerResponse, next: () => void) => {
    const url = new URL(request.url ?? '/', 'http://station');
    if (url.pathname.startsWith('/view/')) {
      response.setHeader('Content-Type', 'text/html');
      response.end(SCENE);
    } else if (url.pathname.startsWith('/api/')) {
      void readBody(request).then((body) => send(response, route(station, request, url, body)));
    } else next();
  };
  return {
    name: 'mock-station',
    configureServer: ({ middlewares, httpServer }) => {
      middlewares.use(handle);
      if (httpServer) serveLive(httpServer as Server, station);
    },
    configurePreviewServer: ({ middlewares, httpServer }) => {
      middlewares.use((request, response, next) => {
        if (!request.url?.startsWith('/view/')) {
          response.setHeader('Content-Security-Policy', POLICY);
        }
        next();
      });
      middlewares.use(handle);
      serveLive(httpServer as Server, station);
    },
  };
}

function serveLive(server: Server, station: FakeStation): void {
  const live = new WebSocketServer({ noServer: true });
  server.on('upgrade', (request, socket, head) => {
    if (!request.url?.startsWith('/api/live')) return;
    live.handleUpgrade(request, socket, head, (client) => {
      let cursor = 0;
      const timer = setInterval(() => {
        const tick = station.tick(cursor);
        cursor = tick.cursor;
        client.send(JSON.stringify(tick));
      }, TICK_MS);
      client.on('close', () => clearInterval(timer));
    });
  });
}

async function readBody(request: IncomingMessage): Promise<JsonObject> {
  const chunks: Buffer[] = [];
  for await (const chunk of request) chunks.push(chunk as Buffer);
  try {
    return JSON.parse(Buffer.concat(chunks).toString()) as JsonObject;
  } catch {
    return {};
  }
}

function send(response: ServerResponse, answer: Answer): void {
  const {
    status = 200,
    body = {},
    headers = {},
  } = answer ?? problem(404, 'There is nothing here.');
  response.writeHead(status, { 'Content-Type': 'application/json', ...headers });
  response.end(JSON.stringify(body));
}

function problem(status: number, detail: string, errors: unknown[] = []): NonNullable<Answer> {
  return { status, body: { type: 'about:blank', title: 'Refused', status, detail, errors } };
}

function route(station: FakeStation, request: IncomingMessage, url: URL, body: JsonObject): Answer {
  const [, first = '', second = '', third = '', fourth = '', fifth = ''] = url.pathname
    .split('/')
    .slice(1);
  const method = request.method ?? 'GET';
  if (first === 'health') return { body: health(station) };
  if (first === 'session') return session(station, method, body);
  if (!station.isSignedIn) return problem(401, 'Sign in first.');
  if (first === 'robots') return robots(station, method, url, [second, third, fourth, fifth], body);
  if (first === 'missions') return missions(station, method, second, third);
  if (first === 'plans') return plans(station, second, third, body);
  if (first === 'transfers') return transfers(station, second, third);
  if (first === 'gateways') return station.links.gateways(method, second, body);
  if (first === 'surveys') return surveys(station, body);
  if (first === 'commands') return { body: station.commands.get(second) };
  if (first === 'config') return config(station, request, url, second, third, body);
  if (first === 'events') return events(station, url);
  if (first === 'alarms') return alarms(station, second);
  if (first === 'imports') return { status: 202, body: { id: station.importJob().id } };
  if (first === 'jobs') return jobs(station, method, second);
  if (first === 'vehicles') return station.control.vehicles(second, third, url.searchParams);
  if (first === 'whatifs') return station.control.whatIf(second);
  if (first === 'identifications') return station.control.identification(second, third);
  if (first === 'deployments') return { body: { deployments: deployments(station) } };
  return null;
}

function health(station: FakeStation): unknown {
  return {
    status: 'ok',
    ready: true,
    first_start: false,
    simulation: true,
    version: '0.1.0',
    storage: { ok: true, message: '' },
    robots: 2,
    clock: { now: iso(station.now()), speed: station.speed },
  };
}

function session(station: FakeStation, method: string, body: JsonObject): Answer {
  if (method === 'POST' && body.password === 'wrong')
    return problem(401, 'Name or password is wrong.');
  if (method !== 'GET') {
    station.isSignedIn = method === 'POST';
    return {};
  }
  if (!station.isSignedIn) return problem(401, 'Sign in first.');
  const expires = iso(station.now() + 43_200_000);
  return {
    body: { name: 'anna', role: 'admin', rights: [], csrf_token: 'x', expires_at: expires },
  };
}

function robots(
  station: FakeStation,
  method: string,
  url: URL,
  [id, part, item, action]: [string, string, string, string],
  body: JsonObject,
): Answer {
  const now = station.now();
  if (id === '') return { body: station.robots.map((robot) => robot.robot(now)) };
  const robot = station.robot(id);
  if (!robot) return problem(404, `There is no robot '${id}'.`);
  const start = Date.parse(url.searchParams.get('start') ?? iso(now - 900_000));
  const end = Date.parse(url.searchParams.get('end') ?? iso(now));
  const points = Math.min(600, Number(url.searchParams.get('max_points') ?? 500));
  const answer =
    station.control.ofRobot(id, part, item, body) ??
    station.links.ofRobot(robot, method, [part, item], body);
  if (answer) return answer;
  if (part === 'state') return { body: station.live(robot) };
  if (part === 'commands' && method === 'GET') {
    return { body: [...station.commands.values()].filter((each) => each.robot === id) };
  }
  if (part === 'commands')
    return {
      status: 202,
      body: { id: station.command(robot, JSON.stringify(body.kind).slice(1, -1)) },
    };
  if (part === 'track') return { body: robot.track(now - 900_000, now, points) };
  if (part === 'plans' && method === 'GET') {
    const state = url.searchParams.get('state');
    const made = station.pursuits.map(({ plan }) => plan).filter((plan) => plan.robot === id);
    return { body: made.filter((plan) => state === null || plan.state === state).toReversed() };
  }
  if (part === 'plans') {
    return {
      status: 202,
      body: { id: station.pursue(robot, body.config as JsonObject, now).plan.id },
    };
  }
  if (part === 'tracking') {
    const made = station.pursuits.findLast(({ plan, pursuit }) => {
      const wanted = url.searchParams.get('plan');
      return pursuit !== null && plan.robot === id && (wanted === null || plan.id === wanted);
    });
    const after = Date.parse(url.searchParams.get('after') ?? iso(0));
    made?.step(now);
    const reports = (made?.pursuit?.reports ?? []).filter(
      ({ measured_at }) => Date.parse(measured_at) > after,
    );
    return { body: { robot: id, plan_id: made?.plan.id ?? null, reports } };
  }
  if (part === 'missions' && method === 'GET') {
    const own = station.surveys.filter(({ mission }) => mission.robot === id);
    return { body: own.map(({ mission }) => mission).toReversed() };
  }
  if (part === 'missions') {
    const total = (body.config as JsonObject).total_budget;
    if (typeof total === 'number' && total > 500) {
      return problem(422, '1 field is wrong.', [
        { loc: ['config', 'total_budget'], msg: 'The battery holds 500 energy units.' },
      ]);
    }
    const survey = station.survey(robot, body.config as JsonObject, body.automation === true);
    return { status: 202, body: { id: survey.mission.id } };
  }
  if (part === 'view') return station.maps.view(robot, method === 'PATCH' ? body : {});
  if (part === 'maps') {
    const model = url.searchParams.get('model') ?? '';
    return station.maps.ofRobot(robot, item, action, method, model);
  }
  if (part !== 'samples') return null;
  const channel = url.searchParams.get('channel') ?? '';
  const times = Array.from({ length: points }, (_, i) => start + ((end - start) * i) / points);
  const gap = (at: number) => Math.floor(at / 60_000) % 7 === 3 && at < now - 120_000;
  const kept = times.filter((at) => !gap(at));
  const unit = robot.live(now).channels[channel]?.unit ?? '';
  const taken = url.searchParams.has('positions') ? robot.track(start, end, points) : null;
  return {
    body: {
      robot: id,
      channel,
      unit,
      measured_at: kept.map(iso),
      value: kept.map((at) => robot.sample(channel, at)),
      decimated: true,
      ...(taken && {
        measured_at: taken.measured_at,
        value: taken.measured_at.map((at) => robot.sample(channel, Date.parse(at))),
        north_m: taken.north_m,
        east_m: taken.east_m,
        depth_m: taken.depth_m,
        fidelity: taken.fidelity,
        smoothed: taken.fidelity.map((_, i) => i < points * 0.7),
      }),
    },
  };
}

function surveys(station: FakeStation, body: JsonObject): Answer {
  const begun = (body.robots as string[]).flatMap((id) => {
    const robot = station.robot(id);
    if (!robot) return [];
    const survey = station.survey(robot, body.config as JsonObject, body.automation === true);
    return [{ robot: id, mission: survey.mission.id }];
  });
  return { status: 202, body: { missions: begun } };
}

function missions(station: FakeStation, method: string, id: string, action: string): Answer {
  const survey = station.surveys.find(({ mission }) => mission.id === id);
  if (!survey) return problem(404, `There is no mission '${id}'.`);
  if (method === 'GET') return { body: survey.mission };
  survey.mission.automation = action === 'start';
  if (action === 'start' && survey.plan?.state === 'draft') survey.send(station.now());
  return { status: 202, body: {} };
}

function plans(station: FakeStation, id: string, action: string, body: JsonObject): Answer {
  const pursuit = station.pursuits.find(({ plan }) => plan.id === id);
  if (pursuit) return pursuitPlan(station, pursuit, action, body);
  const survey = station.surveys.find((each) => each.plans.some((plan) => plan.id === id));
  const plan = survey?.plans.find((each) => each.id === id);
  if (!survey || !plan) return problem(404, `There is no plan '${id}'.`);
  if (action === 'satellite') return { body: station.links.quote(plan.sha256 ?? '') };
  if (action === 'upload') {
    return { status: 202, body: { transfer: upload(station, survey, body) } };
  }
  if (action === 'cancel') survey.cancel(station.now());
  if (action === 'choose') {
    return { status: 202, body: { id: survey.choose(Number(body.runner_up), station.now()) } };
  }
  if (action === 'continue') return { status: 202, body: { id: survey.searchOn(station.now()) } };
  return { body: { ...plan, transfer: station.links.transfers.of(id) } };
}

function pursuitPlan(
  station: FakeStation,
  pursuit: FakePursuitPlan,
  action: string,
  body: JsonObject,
): Answer {
  const { plan } = pursuit;
  if (action === 'satellite') return { body: station.links.quote(plan.sha256 ?? '') };
  if (action === 'upload') {
    return { status: 202, body: { transfer: upload(station, pursuit, body) } };
  }
  if (action === 'cancel') pursuit.cancel(station.now());
  return { body: { ...plan, transfer: station.links.transfers.of(plan.id) } };
}

function upload(station: FakeStation, flight: FakeFlight, body: JsonObject): string {
  const isLake = flight.robot.site.kind === 'lake' && process.env.MOCK_NEAR !== '1';
  const isSatellite = body.route === 'satellite' || (body.route === 'auto' && isLake);
  return station.links.transfers.begin(flight, isSatellite);
}

function transfers(station: FakeStation, id: string, action: string): Answer {
  const transfer = station.links.transfers.byId.get(id);
  if (!transfer) return problem(404, `There is no transfer '${id}'.`);
  if (action === 'withdraw') station.links.transfers.withdraw(id);
  return { body: transfer };
}

function config(
  station: FakeStation,
  request: IncomingMessage,
  url: URL,
  kind: string,
  part: string,
  body: JsonObject,
): Answer {
  if (kind === '') {
    const ids = station.robots.map(({ id }) => id);
    return {
      body: Object.entries(KINDS).map(([key, { title }]) => ({ kind: key, title, robots: ids })),
    };
  }
  if (part === 'schema') return { body: KINDS[kind]?.schema };
  const robot = url.searchParams.get('robot') ?? '';
  const current = station.config(kind, robot);
  if (request.method === 'PATCH') {
    const wanted = request.headers['if-match'];
    if (wanted !== undefined && wanted !== `"${current.id}"`) {
      return problem(412, `Changed by ${current.by} at ${current.at}.`);
    }
    station.patch(kind, robot, body);
  }
  const { id, value, at, by } = station.config(kind, robot);
  return {
    body: {
      kind,
      robot,
      id: `config-${id}`,
      value,
      preset: KINDS[kind]?.value,
      changed_at: at,
      changed_by: by,
    },
    headers: { ETag: `"${id}"` },
  };
}

function events(station: FakeStation, url: URL): Answer {
  const after = Number(url.searchParams.get('after') ?? 0);
  const found = station.events.filter(({ cursor }) => cursor > after);
  return { body: { events: found, next: found.at(-1)?.cursor ?? null } };
}

function alarms(station: FakeStation, id: string): Answer {
  const alarm = station.alarms.find((each) => each.id === id);
  if (alarm) {
    alarm.state = 'acknowledged';
    alarm.acknowledged_at = iso(station.now());
    alarm.acknowledged_by = 'anna';
  }
  return { body: { alarms: station.alarms } };
}

function jobs(station: FakeStation, method: string, id: string): Answer {
  const job = station.jobs.get(id);
  if (job && method === 'DELETE') job.state = 'cancelled';
  return { body: job };
}

function deployments(station: FakeStation): unknown {
  return station.robots.map(({ id, site }, i) => ({
    id: `deployment-${i + 1}`,
    name: `${site.name}, ${iso(station.started).slice(0, 10)}`,
    robot: id,
    started_at: iso(station.started - 3_600_000),
    ended_at: null,
    kind: 'live',
    variables: [site.variable],
    samples: 1104 + i,
    source: '',
    skipped_rows: 0,
    scores: [],
  }));
}
