import { Problem, sentence } from '../api/problem';
import type { Command, CommandKind } from '../api/types';
import type { Station } from './station.svelte';

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
  readonly #station: Station;

  constructor(station: Station) {
    this.#station = station;
  }

  async give(robot: string, kind: CommandKind): Promise<void> {
    this.byRobot[robot] = { robot, kind, command: null, refusal: null };
    try {
      const { id } = await this.#station.api.command(robot, kind);
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
    return this.#station.onBatch(({ commands }, isFirst) => {
      for (const { robot, kind, command } of Object.values(this.byRobot)) {
        if (command === null) continue;
        const told = commands[command.id];
        if (told) this.byRobot[robot] = { robot, kind, command: told, refusal: null };
        else if (isFirst && !isSettled(command))
          void this.#ask(robot, kind, command.id).catch(() => undefined);
      }
    });
  }

  async #ask(robot: string, kind: CommandKind, id: string): Promise<void> {
    const asked = await this.#station.api.commandState(id);
    const known = this.byRobot[robot]?.command;
    if (known && known.id !== id && known.created_at > asked.created_at) return;
    const told = this.#station.commands[id];
    const isOvertaken = told !== undefined && told.levels.length > asked.levels.length;
    this.byRobot[robot] = { robot, kind, command: isOvertaken ? told : asked, refusal: null };
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
