import type {
  Gateway,
  JsonObject,
  LogFile,
  Parameter,
  RobotLink,
  SatelliteLog,
  SatelliteQuote,
} from '../src/api/types';
import { iso, type FakeRobot } from './robot';
import { FakeTransfers } from './transfer';
import type { FakeStation } from './station';

type Answer = { status?: number; body?: unknown } | null;

const STEP_MS = 250;
const SESSION_MS = 12_000;
const BUDGET = 100;

function refused(status: number, detail: string, errors: unknown[] = []): Answer {
  return { status, body: { type: 'about:blank', title: 'Refused', status, detail, errors } };
}

function fakeParameters(): Parameter[] {
  const rows: [string, number, string][] = [
    ['BUOY_MAX_KG', 0.06, 'real32'],
    ['BUOY_RATE', 0.0042, 'real32'],
    ['CTRL_KIND', 2, 'uint8'],
    ['CTRL_K_DEPTH', 0.82, 'real32'],
    ['CTRL_K_PITCH', 1.4, 'real32'],
    ['DEPTH_LIMIT_M', 16.5, 'real32'],
    ['HEADING_TRIM', -0.0125, 'real32'],
    ['SAT_PERIOD_S', 1800, 'int32'],
    ['SAT_SILENCE_S', 600, 'int32'],
    ['TAIL_MAX_RAD', 0.52, 'real32'],
  ];
  return rows.map(([name, value, type]) => {
    return { name, value, type, is_integer: type !== 'real32', pending: false };
  });
}

/** Links, satellite, gateways, parameters and logs of the fake station. */
export class FakeLinks {
  readonly transfers: FakeTransfers;
  readonly log: Pick<SatelliteLog, 'outgoing' | 'incoming'>;
  credits = 12;
  #unplugged = new Set<string>();
  #momsn = 41;
  #mtmsn = 108;
  #parameters: Record<string, { read_at: string | null; parameters: Parameter[] }> = {};
  #logs: Record<string, { read_at: string | null; logs: LogFile[] }> = {};
  readonly #station: FakeStation;
  readonly #gateways: Gateway[] = [
    {
      kind: 'rockblock', title: 'RockBLOCK', url: 'http://127.0.0.1:18080/rockblock/MT', username: 'grace-demo',
      has_password: true, has_public_key: true, confirms: false, port: null,
      push_url: '/api/gateways/rockblock/push/k3vQ9pXtB2mW7sLd', accepted: 41, duplicate: 6,
      refused: { signature: 1, too_large: 0, bad_path: 2 }, last_at: iso(Date.now() - 2_000_000), fault: null,
    },
    {
      kind: 'directip', title: 'DirectIP', url: 'tcp://directip.sbd.iridium.com:10800', username: '', has_password: false,
      has_public_key: false, confirms: false, port: null, push_url: null, accepted: 0, duplicate: 0,
      refused: {}, last_at: null, fault: null,
    },
    {
      kind: 'cloudloop', title: 'Cloudloop', url: 'https://api.cloudloop.com', username: '', has_password: false,
      has_public_key: false, confirms: false, port: null,
      push_url: '/api/gateways/cloudloop/push/k3vQ9pXtB2mW7sLd', accepted: 0, duplicate: 0, refused: {},
      last_at: null, fault: null,
    },
  ]; // prettier-ignore

  constructor(station: FakeStation) {
    this.#station = station;
    this.transfers = new FakeTransfers(station, this);
    const at = (minutes: number) => iso(station.started - minutes * 60_000);
    this.log = {
      outgoing: [
        {
          at: at(191), kind: 'order', bytes: 38, credits: 1, state: 'radio', message_id: '91822',
          mtmsn: 107, text: 'Surface order 14 for grace-1.',
        },
        {
          at: at(95), kind: 'plan', bytes: 270, credits: 6, state: 'refused', message_id: null,
          mtmsn: null, text: 'Part 1 of 2 of plan 9: the account has no credit left.',
        },
      ],
      incoming: [
        {
          session_at: at(190), arrived_at: at(189), momsn: 39, mtmsn: 107, bytes: 131,
          credits: 2, is_duplicate: false, is_decoded: true, text: 'State, plan report, answer to order 14, 6 samples.',
        },
        {
          session_at: at(190), arrived_at: at(184), momsn: 39, mtmsn: 107, bytes: 131,
          credits: 2, is_duplicate: true, is_decoded: true, text: 'Delivered again by the gateway.',
        },
        {
          session_at: at(34), arrived_at: at(33), momsn: 40, mtmsn: null, bytes: 46,
          credits: 2, is_duplicate: false, is_decoded: false, text: 'Kept as it came: its seal does not fit the key of grace-1.',
        },
      ],
    }; // prettier-ignore
  }

  nextMtmsn(): number {
    return ++this.#mtmsn;
  }

  /** Station time of the next session, ms. */
  nextSession(): number {
    const now = this.#station.now();
    return now - (now % SESSION_MS) + SESSION_MS;
  }

  noteSession(bytes: number, mtmsn: number | null, text: string): void {
    const now = this.#station.now();
    this.log.incoming.unshift({
      session_at: iso(now - 2000), arrived_at: iso(now), momsn: ++this.#momsn, mtmsn, bytes,
      credits: 2, is_duplicate: false, is_decoded: true, text,
    }); // prettier-ignore
  }

  of(robot: FakeRobot): RobotLink[] {
    const now = this.#station.now();
    const base = robot.live(now).link;
    const isFar = robot.site.kind === 'lake' && process.env.MOCK_NEAR !== '1';
    const radio: RobotLink = {
      uri: 'xbee:///tmp/radio', carrier: 'xbee', kind: 'radio', is_plugged: true,
      state: isFar ? 'stale' : base.state, heard_at: isFar ? iso(this.#station.started - 2_040_000) : base.heard_at,
      rssi_dbm: isFar ? null : base.rssi_dbm, frames_received: base.frames_received,
      frames_bad: base.frames_bad, text: isFar ? `XBee does not hear ${robot.id} any more.` : '',
      carries: isFar ? ['surface'] : ['telemetry', 'plan', 'command', 'surface', 'parameters', 'files'],
    }; // prettier-ignore
    if (robot.site.kind !== 'lake') return [radio].map((link) => this.#plugged(robot, link));
    const heard = this.log.incoming.find(({ is_duplicate }) => !is_duplicate);
    const satellite: RobotLink = {
      uri: 'rockblock://300434061799480', carrier: 'rockblock', kind: 'satellite', is_plugged: true,
      state: 'live', heard_at: heard?.arrived_at ?? null, rssi_dbm: null,
      frames_received: this.log.incoming.length + 38, frames_bad: 1,
      text: `${robot.id} calls by RockBLOCK regularly.`,
      carries: isFar ? ['plan', 'command', 'surface'] : ['surface'],
    }; // prettier-ignore
    const acoustic: RobotLink = {
      uri: 'micromodem:///tmp/modem?us=1&peer=2', carrier: 'micromodem', kind: 'acoustic',
      is_plugged: true, state: 'live', heard_at: iso(now - 4200), rssi_dbm: null,
      frames_received: 311, frames_bad: 0, text: '', carries: ['range'],
    }; // prettier-ignore
    return [radio, satellite, acoustic].map((link) => this.#plugged(robot, link));
  }

  #plugged(robot: FakeRobot, link: RobotLink): RobotLink {
    return this.#unplugged.has(`${robot.id} ${link.uri}`)
      ? { ...link, is_plugged: false, state: 'unplugged', carries: [] }
      : link;
  }

  ofRobot(robot: FakeRobot, method: string, [part, item]: [string, string], body: JsonObject): Answer {
    if (part === 'links' && method === 'POST') {
      const key = `${robot.id} ${JSON.stringify(body.uri).slice(1, -1)}`;
      if (body.plugged === true) this.#unplugged.delete(key);
      else this.#unplugged.add(key);
    }
    if (part === 'links') return { body: this.of(robot) };
    if (part === 'satellite') return { body: this.satelliteLog(robot) };
    if (part === 'parameters') return this.#ofParameters(robot, method, item, body);
    if (part === 'logs') return this.#ofLogs(robot, item, body);
    return null;
  } // prettier-ignore

  satelliteLog(robot: FakeRobot): SatelliteLog {
    const has = robot.site.kind === 'lake';
    return {
      imei: has ? '300434061799480' : null, carrier: has ? 'rockblock' : '', credits_today: this.credits,
      credits_per_day: BUDGET, credits_left: BUDGET - this.credits, credits_heard_today: 12,
      next_session_at: has ? iso(this.nextSession()) : null,
      ...(has ? this.log : { outgoing: [], incoming: [] }),
    }; // prettier-ignore
  }

  quote(sha256: string): SatelliteQuote {
    const messages = [
      { index: 0, bytes: 270, credits: 6 },
      { index: 1, bytes: 176, credits: 4 },
    ];
    const left = BUDGET - this.credits;
    return {
      sha256, bytes: 406, messages, credits: 10, price: 1.2, currency: 'GBP',
      credits_left_today: left, credits_per_day: BUDGET,
      earliest_delivery_at: iso(this.nextSession()),
      text: 'A part that is lost on the way is sent again and costs again.',
      refusal: left < 10 ? `Today’s budget of ${BUDGET} credits leaves ${left}; this plan takes 10.` : null,
      may_force: false,
      auto: { route: 'satellite', reason: 'By satellite: the radio does not reach the robot.' },
    }; // prettier-ignore
  }

  gateways(method: string, kind: string, body: JsonObject): Answer {
    if (method === 'PUT') {
      const gateway = this.#gateways.find((each) => each.kind === kind);
      if (!gateway) return refused(404, `There is no gateway '${kind}'.`);
      const { password, public_key: key, ...plain } = body;
      Object.assign(gateway, plain);
      gateway.has_password ||= password !== undefined;
      gateway.has_public_key ||= key !== undefined;
    }
    return { body: { gateways: this.#gateways } };
  }

  #job(kind: string, message: (share: number) => string, ondone: () => void): Answer {
    const { jobs } = this.#station;
    const id = `job-${jobs.size + 1}`;
    const created_at = iso(this.#station.now());
    jobs.set(id, { id, kind, state: 'running', progress: 0, message: '', result: null, created_at });
    const timer = setInterval(() => {
      const job = jobs.get(id);
      if (job?.state !== 'running') return clearInterval(timer);
      job.progress = Math.min(1, job.progress + 0.07);
      job.message = message(job.progress);
      if (job.progress < 1) return;
      job.state = 'done';
      ondone();
    }, STEP_MS);
    return { status: 202, body: { job: id } };
  } // prettier-ignore

  #ofParameters(robot: FakeRobot, method: string, name: string, body: JsonObject): Answer {
    const table = (this.#parameters[robot.id] ??= { read_at: null, parameters: [] });
    if (name === 'read') {
      const all = fakeParameters();
      return this.#job(
        'read_parameters',
        (share) => `${Math.round(share * all.length)} of ${all.length} parameters`,
        () => {
          table.parameters = all;
          table.read_at = iso(this.#station.now());
        },
      );
    }
    if (method === 'PUT') {
      const known = table.parameters.find((each) => each.name === name);
      if (!known) return refused(404, `${robot.id} has named no parameter '${name}'.`);
      if (name === 'TAIL_MAX_RAD' && Number(body.value) > 1) {
        return refused(409, `${robot.id} refused: TAIL_MAX_RAD is limited to 0.6.`);
      }
      known.value = Number(body.value);
      return { body: known };
    }
    return { body: table };
  }

  #ofLogs(robot: FakeRobot, action: string, body: JsonObject): Answer {
    const table = (this.#logs[robot.id] ??= { read_at: null, logs: [] });
    if (action === 'read') {
      return this.#job('list_logs', () => `Asking ${robot.id} for its files.`, () => {
        table.read_at = iso(this.#station.now());
        table.logs = ['/log/0007.bin', '/log/0008.bin', '/log/boot.txt'].map((path, i) => ({
          id: `log-${i + 1}`, path, bytes: 184_320 + i * 91_113, modified_at: null, downloaded: null,
        }));
      });
    }
    if (action === 'download') {
      const log = table.logs.find(({ path }) => path === body.path);
      if (!log) return refused(404, `${robot.id} has named no such file.`);
      return this.#job('fetch_log', (share) => `${Math.round((share * log.bytes) / 1000)} of ${Math.round(log.bytes / 1000)} kB`, () => {
        log.downloaded = { id: log.id, at: iso(this.#station.now()), bytes: log.bytes, sha256: '9f'.repeat(32) };
      });
    }
    return { body: table };
  } // prettier-ignore
}
