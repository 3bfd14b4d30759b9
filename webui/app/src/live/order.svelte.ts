import { Problem, sentence } from '../api/problem';
import type { Api } from '../api/client';
import type { Command, CommandKind } from '../api/types';

const ASK_EVERY_MS = 700;
const KEY = 'grace.orders';

/** One order to a robot as this browser follows it. */
export interface Order {
  robot: string;
  kind: CommandKind;
  /** What the station says of it; `null` until it has answered. */
  command: Command | null;
  /** Why the station did not take it, in words. */
  refusal: string | null;
}

/** The latest order to each robot, followed until its outcome is known; survives a reload. */
export class Orders {
  byRobot = $state<Record<string, Order>>({});
  readonly #api: Api;
  #timer: ReturnType<typeof setInterval> | undefined;

  constructor(api: Api) {
    this.#api = api;
  }

  async give(robot: string, kind: CommandKind): Promise<void> {
    this.byRobot[robot] = { robot, kind, command: null, refusal: null };
    try {
      const { id } = await this.#api.command(robot, kind);
      await this.#ask(robot, kind, id);
    } catch (error) {
      this.byRobot[robot] = { robot, kind, command: null, refusal: refusalOf(error) };
    }
    this.#keep();
  }

  dismiss(robot: string): void {
    const { [robot]: _gone, ...others } = this.byRobot;
    this.byRobot = others;
    this.#keep();
  }

  /** Follow the open orders; returns the end of it. */
  follow(): () => void {
    for (const { robot, kind, id } of kept())
      void this.#ask(robot, kind, id).catch(() => undefined);
    this.#timer = setInterval(() => this.#askOpen(), ASK_EVERY_MS);
    return () => clearInterval(this.#timer);
  }

  #askOpen(): void {
    for (const { robot, kind, command } of Object.values(this.byRobot)) {
      if (command !== null && !isSettled(command)) {
        void this.#ask(robot, kind, command.id).catch(() => undefined);
      }
    }
  }

  async #ask(robot: string, kind: CommandKind, id: string): Promise<void> {
    const command = await this.#api.commandState(id);
    const known = this.byRobot[robot]?.command;
    if (known && known.id !== id && known.created_at > command.created_at) return;
    this.byRobot[robot] = { robot, kind, command, refusal: null };
  }

  #keep(): void {
    const ids = Object.values(this.byRobot).flatMap(({ robot, kind, command }) =>
      command === null ? [] : [{ robot, kind, id: command.id }],
    );
    try {
      sessionStorage.setItem(KEY, JSON.stringify(ids));
    } catch {
      // Without storage a reload forgets the order on the screen; the log has it.
    }
  }
}

/** Whether an order was taken is said only where it is known. */
function refusalOf(error: unknown): string {
  const isUnknown = error instanceof Problem && error.status === 0;
  return isUnknown ? sentence(error) : `Not taken. ${sentence(error)}`;
}

export function isSettled(command: Command): boolean {
  return ['applied', 'refused', 'expired'].includes(command.level);
}

function kept(): { robot: string; kind: CommandKind; id: string }[] {
  try {
    return JSON.parse(sessionStorage.getItem(KEY) ?? '[]') as ReturnType<typeof kept>;
  } catch {
    return [];
  }
}
