import { Problem, sentence } from '../api/problem';
import type { Command, CommandKind } from '../api/types';
import type { Station } from './station.svelte';

const KEY = 'grace.orders';

/** One order to a robot as this browser follows it. */
export interface Order {
  robot: string;
  kind: CommandKind;
  /** What the station calls it; `null` until it has answered. */
  id: string | null;
  /** What the station says of it; `null` until the live stream tells. */
  command: Command | null;
  /** Why the station did not take it, in words. */
  refusal: string | null;
}

/** The latest order to each robot, followed until its outcome is known; survives a reload. */
export class Orders {
  byRobot = $state<Record<string, Order>>({});
  readonly #station: Station;
  /** The newest order to each robot, by its turn; an earlier one may be answered later. */
  readonly #newest: Record<string, number> = {};
  #turn = 0;

  constructor(station: Station) {
    this.#station = station;
  }

  async give(robot: string, kind: CommandKind): Promise<void> {
    const asked = { robot, kind, id: null, command: null, refusal: null };
    this.byRobot[robot] = asked;
    const turn = ++this.#turn;
    this.#newest[robot] = turn;
    try {
      const { id } = await this.#station.api.command(robot, kind);
      if (this.#newest[robot] !== turn) return; // a later order was given meanwhile
      this.byRobot[robot] = { ...asked, id, command: this.#station.commands[id] ?? null };
    } catch (error) {
      if (this.#newest[robot] !== turn) return;
      this.byRobot[robot] = { ...asked, refusal: refusalOf(error) };
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
      for (const order of Object.values(this.byRobot)) {
        const { robot, kind, id, command } = order;
        if (id === null) continue;
        const told = commands[id];
        if (told) this.byRobot[robot] = { ...order, command: told };
        else if (isFirst && !(command && isSettled(command)))
          void this.#ask(robot, kind, id).catch(() => undefined);
      }
    });
  }

  async #ask(robot: string, kind: CommandKind, id: string): Promise<void> {
    const asked = await this.#station.api.commandState(id);
    const known = this.byRobot[robot];
    if (known && known.id !== id) return; // a later order was given meanwhile
    const told = this.#station.commands[id];
    const isOvertaken = told !== undefined && told.levels.length > asked.levels.length;
    this.byRobot[robot] = { robot, kind, id, command: isOvertaken ? told : asked, refusal: null };
  }

  #keep(): void {
    const ids = Object.values(this.byRobot).flatMap(({ robot, kind, id }) =>
      id === null ? [] : [{ robot, kind, id }],
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
