/** Shapes of links, satellite messages, gateways, parameters and logs; conventions as in `types.ts`. */

import type { Time } from './types';

export type LinkKind = 'radio' | 'satellite' | 'acoustic';

export interface RobotLink {
  uri: string;
  carrier: string;
  kind: LinkKind;
  state: string;
  /** Whether an operator lets the station use it. */
  is_plugged: boolean;
  heard_at: Time | null;
  rssi_dbm: number | null;
  frames_received: number;
  frames_bad: number;
  /** What the station says of it, a sentence. */
  text: string;
  /** Kinds of messages that it carries now, such as `plan`. */
  carries: string[];
}

/** Way of a plan to its robot; `auto` leaves it to the station. */
export type RouteChoice = 'auto' | 'radio' | 'satellite';

/** The way that a plan would take, and why. */
export interface Way {
  route: 'radio' | 'satellite';
  reason: string;
}

export interface QuoteMessage {
  index: number;
  bytes: number;
  credits: number;
}

/** What sending a plan by satellite takes, before anything is sent. */
export interface SatelliteQuote {
  sha256: string;
  bytes: number;
  messages: QuoteMessage[];
  credits: number;
  price: number;
  currency: string;
  credits_left_today: number;
  credits_per_day: number;
  earliest_delivery_at: Time | null;
  text: string;
  /** Why the station would not send it by satellite, a sentence. */
  refusal: string | null;
  /** Whether a person's word overrules the refusal. */
  may_force: boolean;
  /** What `auto` takes now, and why. */
  auto: Way;
}

export type PartLevel = 'waiting' | 'queued' | 'radio';

/** One message of a plan that goes by satellite. */
export interface TransferPart {
  index: number;
  bytes: number;
  credits: number;
  /** How often it was handed to the gateway. */
  sends: number;
  level: PartLevel;
  message_id: string | null;
  mtmsn: number | null;
  queued_at: Time | null;
  radio_at: Time | null;
}

export interface OutgoingMessage {
  at: Time;
  kind: string;
  bytes: number;
  credits: number;
  state: string;
  message_id: string | null;
  mtmsn: number | null;
  text: string;
}

export interface IncomingMessage {
  session_at: Time | null;
  arrived_at: Time;
  momsn: number;
  mtmsn: number | null;
  bytes: number;
  credits: number;
  is_duplicate: boolean;
  is_decoded: boolean;
  text: string;
}

export interface SatelliteLog {
  /** `null` for a robot without a satellite link. */
  imei: string | null;
  carrier: string;
  credits_today: number;
  credits_per_day: number;
  credits_left: number;
  /** What the robot's own messages of this UTC day cost; the budget does not hold them back. */
  credits_heard_today: number;
  next_session_at: Time | null;
  outgoing: OutgoingMessage[];
  incoming: IncomingMessage[];
}

/** Account at one satellite gateway. The password goes to the station and never comes back. */
export interface Gateway {
  kind: string;
  title: string;
  /** Where messages to robots go; the gateway's usual address while nobody stored another. */
  url: string;
  username: string;
  has_password: boolean;
  has_public_key: boolean;
  /** Whether DirectIP expects a confirmation of each message of a robot. */
  confirms: boolean;
  /** Where the gateway shall push what robots say; `null` of one that delivers to `port`. */
  push_url: string | null;
  port: number | null;
  accepted: number;
  duplicate: number;
  /** How many pushes were refused, by reason. */
  refused: Record<string, number>;
  /** When the last message came. */
  last_at: Time | null;
  /** Why the account cannot be read. */
  fault: string | null;
}

export interface GatewayChange {
  url?: string;
  username?: string;
  password?: string;
  public_key?: string;
  confirms?: boolean;
}

export interface Parameter {
  name: string;
  value: number;
  type: string;
  is_integer: boolean;
  /** A value is on its way and not proved. */
  pending: boolean;
  read_at?: Time;
}

export interface ParameterTable {
  /** When all of them were read; `null` if never. */
  read_at: Time | null;
  parameters: Parameter[];
}

export interface LogFile {
  id: string;
  path: string;
  /** When it was listed; a log that is still written grows. */
  bytes: number;
  modified_at: Time | null;
  /** The copy that the station has. */
  downloaded: { id: string; at: Time; bytes: number; sha256: string } | null;
  /** The newest job that fetches it or did; `null` if there was none since the station began. */
  job?: string | null;
}

export interface LogListing {
  read_at: Time | null;
  logs: LogFile[];
  /** The newest job that lists them or did. */
  job?: string | null;
}
