import { at, listed, part, queryString, type Listed, type Road } from './road';
import type {
  Gateway,
  GatewayChange,
  LogListing,
  Parameter,
  ParameterTable,
  RobotLink,
  SatelliteLog,
  SatelliteQuote,
  Transfer,
} from './types';

/** The part of the REST interface that is about links and what they carry. */
export class LinkApi {
  readonly #road: Road;

  constructor(road: Road) {
    this.#road = road;
  }

  links = (robot: string) => this.#road.json<RobotLink[]>('GET', `${at(robot)}/links`);

  /** Let the station use a link, or let it alone until it is plugged in again. */
  plug = (robot: string, uri: string, plugged: boolean) =>
    this.#road.json<RobotLink[]>('POST', `${at(robot)}/links/plug`, { body: { uri, plugged } });

  /** What sending a plan by satellite would take; nothing is sent. */
  quote = (plan: string, signal?: AbortSignal) =>
    this.#road.json<SatelliteQuote>('GET', `/api/plans/${part(plan)}/satellite`, { signal });

  transfer = (id: string, signal?: AbortSignal) =>
    this.#road.json<Transfer>('GET', `/api/transfers/${part(id)}`, { signal });

  withdraw = (transfer: string) =>
    this.#road.send('POST', `/api/transfers/${part(transfer)}/withdraw`);

  satelliteLog = (robot: string) => this.#road.json<SatelliteLog>('GET', `${at(robot)}/satellite`);

  gateways = async () => listed(await this.#road.json<Listed<Gateway>>('GET', '/api/gateways'));

  changeGateway = (kind: string, change: GatewayChange) =>
    this.#road.send('PUT', `/api/gateways/${part(kind)}`, { body: change });

  parameters = (robot: string) => this.#road.json<ParameterTable>('GET', `${at(robot)}/parameters`);

  readParameters = (robot: string) =>
    this.#road.json<{ job: string }>('POST', `${at(robot)}/parameters/read`);

  /** Write one and read it back; the answer is what the robot has now. */
  writeParameter = (robot: string, name: string, value: number) =>
    this.#road.json<Parameter>('PUT', `${at(robot)}/parameters/${part(name)}`, {
      body: { value },
    });

  logs = (robot: string) => this.#road.json<LogListing>('GET', `${at(robot)}/logs`);

  readLogs = (robot: string) => this.#road.json<{ job: string }>('POST', `${at(robot)}/logs/read`);

  downloadLog = (robot: string, path: string) =>
    this.#road.json<{ job: string }>('POST', `${at(robot)}/logs/download`, { body: { path } });
}

/** Address of the station's copy of a log. */
export function logPath(robot: string, id: string): string {
  return `${at(robot)}/logs/${part(id)}`;
}

/** Address of the raw journal of a robot between two moments, as a file that replay tools read. */
export function journalPath(robot: string, start: string, end: string): string {
  return `/api/journal.tlog${queryString({ robot, start, end })}`;
}
