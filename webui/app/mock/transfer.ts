import type { Plan, Transfer, TransferPart } from '../src/api/types';
import type { FakeLinks } from './link';
import { iso, type FakeRobot } from './robot';
import type { FakeStation } from './station';

const LIFE_MS = 96 * 3_600_000;

/** What has a plan that can be sent: a survey, or the following of a target. */
export interface FakeFlight {
  readonly robot: FakeRobot;
  readonly plan: Plan | undefined;
  send(nowMs: number, isRadio?: boolean): void;
  unsend(): void;
  arrive(nowMs: number): void;
}

/** Plans on their way: by radio item by item, by satellite part by part, with a part lost once. */
export class FakeTransfers {
  readonly byId = new Map<string, Transfer>();
  readonly #station: FakeStation;
  readonly #links: FakeLinks;

  constructor(station: FakeStation, links: FakeLinks) {
    this.#station = station;
    this.#links = links;
  }

  /** Newest transfer of a plan. */
  of(plan: string): Transfer | null {
    return [...this.byId.values()].findLast(({ plan_id }) => plan_id === plan) ?? null;
  }

  begin(survey: FakeFlight, isSatellite: boolean): string {
    const id = `transfer-${this.byId.size + 1}`;
    const { plan } = survey;
    const now = this.#station.now();
    const transfer: Transfer = {
      id, robot: survey.robot.id, plan_id: plan?.id ?? '', state: isSatellite ? 'queued' : 'sending',
      items_sent: 0, items: isSatellite ? 0 : 12, bytes: isSatellite ? 406 : 412, level: 'queued',
      started_at: iso(now), ended_at: null, reason: '', carrier: isSatellite ? 'rockblock' : 'xbee',
      sha256: plan?.sha256 ?? null, expires_at: isSatellite ? iso(now + LIFE_MS) : null, credits: 0,
      parts: [], can_withdraw: isSatellite, text: '',
    }; // prettier-ignore
    this.byId.set(id, transfer);
    if (isSatellite) this.#bySatellite(transfer, survey);
    else this.#byRadio(transfer, survey);
    return id;
  }

  withdraw(id: string): void {
    const transfer = this.byId.get(id);
    if (!transfer) return;
    this.#end(transfer, 'withdrawn', 'anna withdrew it; nothing more of it is sent.');
    const survey = this.#station.flights.find(({ plan }) => plan?.id === transfer.plan_id);
    survey?.unsend();
  }

  #end(transfer: Transfer, state: string, text: string): void {
    if (transfer.ended_at !== null) return;
    Object.assign(transfer, {
      state, level: state, text, ended_at: iso(this.#station.now()), can_withdraw: false,
    }); // prettier-ignore
  }

  #byRadio(transfer: Transfer, survey: FakeFlight): void {
    survey.send(this.#station.now());
    const timer = setInterval(() => {
      transfer.items_sent = Math.min(transfer.items, transfer.items_sent + 2);
      if (transfer.items_sent < transfer.items) return;
      clearInterval(timer);
      this.#end(transfer, 'applied', `${transfer.robot} answered with the fingerprint.`);
    }, 200);
  }

  #bySatellite(transfer: Transfer, survey: FakeFlight): void {
    const name = transfer.plan_id.replace('-', ' ');
    survey.send(this.#station.now(), false);
    transfer.parts = [
      [270, 6],
      [176, 4],
    ].map(([bytes = 0, credits = 0], index): TransferPart => {
      return {
        index, bytes, credits, sends: 0, level: 'waiting', message_id: null, mtmsn: null,
        queued_at: null, radio_at: null,
      }; // prettier-ignore
    });
    const [first, second] = transfer.parts as [TransferPart, TransferPart];
    const after = (ms: number, act: () => void) =>
      setTimeout(() => transfer.ended_at === null && act(), ms);
    transfer.text = `Handing ${name} to RockBLOCK.`;
    after(700, () => this.#queue(transfer, first));
    after(1500, () => {
      this.#queue(transfer, second);
      transfer.text = `RockBLOCK has both parts; ${transfer.robot} has none of them yet.`;
    });
    after(6000, () => {
      this.#fetch(first);
      transfer.text = `${transfer.robot} fetched part 1; part 2 waits for its next session.`;
      this.#links.noteSession(131, first.mtmsn, `State, and it has part 1 of ${name}.`);
    });
    after(9000, () => {
      this.#queue(transfer, second);
      transfer.text = 'Part 2 was lost on the way and is sent again, alone.';
    });
    after(14_000, () => {
      this.#fetch(second);
      transfer.text = `${transfer.robot} has every part and has not answered yet.`;
    });
    if (process.env.MOCK_EXPIRE === '1') {
      after(17_000, () => {
        this.#end(transfer, 'expired', `Not confirmed: the time of ${name} ran out. Nothing more is sent.`);
        survey.unsend();
      }); // prettier-ignore
      return;
    }
    after(17_000, () => {
      this.#links.noteSession(96, second.mtmsn, `State, and the fingerprint of ${name}.`);
      this.#end(transfer, 'applied', `${transfer.robot} answered with the fingerprint of ${name}.`);
      survey.arrive(this.#station.now());
    });
  }

  #queue(transfer: Transfer, part: TransferPart): void {
    const mtmsn = this.#links.nextMtmsn();
    const now = iso(this.#station.now());
    Object.assign(part, {
      level: 'queued', sends: part.sends + 1, mtmsn, message_id: String(91_900 + mtmsn), queued_at: now,
    }); // prettier-ignore
    transfer.credits = (transfer.credits ?? 0) + part.credits;
    this.#links.credits += part.credits;
    this.#links.log.outgoing.unshift({
      at: now, kind: 'plan', bytes: part.bytes, credits: part.credits, state: 'taken',
      message_id: part.message_id, mtmsn, text: `Part ${part.index + 1} of 2 of ${transfer.plan_id.replace('-', ' ')}.`,
    }); // prettier-ignore
  }

  #fetch(part: TransferPart): void {
    Object.assign(part, { level: 'radio', radio_at: iso(this.#station.now()) });
    const sent = this.#links.log.outgoing.find(({ mtmsn }) => mtmsn === part.mtmsn);
    if (sent) sent.state = 'radio';
  }
}
