import type { SatelliteLog } from '../../api/types';
import { type Tone, words } from '../../text/word';

/** One satellite message as the log shows it, whichever way it went. */
export interface TracedMessage {
  key: string;
  robot: string;
  isOut: boolean;
  at: string;
  /** When the gateway brought it, where that is another moment. */
  arrivedAt: string | null;
  title: string;
  text: string;
  bytes: number;
  credits: number | null;
  momsn: number | null;
  mtmsn: number | null;
  messageId: string | null;
  state: string;
  tone: Tone;
}

const STATES: Record<string, { text: string; tone: Tone }> = {
  sending: { text: 'Being handed over', tone: 'accent' },
  taken: { text: 'Taken by the gateway', tone: 'plain' },
  radio: { text: 'Fetched by the robot', tone: 'ok' },
  refused: { text: 'Refused', tone: 'alarm' },
  dropped: { text: 'Not sent any more', tone: 'plain' },
  unknown: { text: 'Not known whether taken', tone: 'watch' },
};

/** Messages of several robots out and in, the newest first. */
export function traceOf(logs: Readonly<Record<string, SatelliteLog>>): TracedMessage[] {
  const all = Object.entries(logs).flatMap(([robot, log]) => [
    ...outgoing(robot, log),
    ...incoming(robot, log),
  ]);
  return all.sort((a, b) => b.at.localeCompare(a.at));
}

function outgoing(robot: string, log: SatelliteLog): TracedMessage[] {
  return log.outgoing.map((message, i) => {
    const word = STATES[message.state] ?? { text: words(message.state), tone: 'plain' as const };
    return {
      key: `${robot} out ${message.at} ${message.mtmsn ?? ''} ${message.message_id ?? i}`,
      robot, isOut: true, at: message.at, arrivedAt: null, title: words(message.kind),
      text: message.text, bytes: message.bytes, credits: message.credits, momsn: null,
      mtmsn: message.mtmsn, messageId: message.message_id, state: word.text, tone: word.tone,
    };
  }); // prettier-ignore
}

function incoming(robot: string, log: SatelliteLog): TracedMessage[] {
  return log.incoming.map((message, i) => {
    const { is_decoded: isDecoded, is_duplicate: isDuplicate } = message;
    const state = isDuplicate ? 'Duplicate, no effect' : isDecoded ? 'Decoded' : 'Not decoded';
    return {
      key: `${robot} in ${message.arrived_at} ${message.momsn} ${i}`,
      robot, isOut: false, at: message.session_at,
      arrivedAt: message.arrived_at, title: 'From the robot', text: message.text,
      bytes: message.bytes, credits: message.credits, momsn: message.momsn, mtmsn: message.mtmsn,
      messageId: null, state, tone: isDuplicate ? 'plain' : isDecoded ? 'ok' : 'watch',
    };
  }); // prettier-ignore
}
