/** Times from a stick that leaves this page to the robot's answer to it, ms. */

const WINDOW_MS = 10_000;
const WAITING_MAX = 200;

export interface Latency {
  answers: number;
  p50: number;
  p95: number;
}

export class RoundTrips {
  readonly #waiting = new Map<number, number>();
  #answered: { at: number; trip: number }[] = [];

  sent(n: number, at: number): void {
    this.#waiting.set(n, at);
    if (this.#waiting.size > WAITING_MAX) {
      const [oldest] = this.#waiting.keys();
      if (oldest !== undefined) this.#waiting.delete(oldest);
    }
  }

  answered(n: number, at: number): void {
    const sentAt = this.#waiting.get(n);
    if (sentAt === undefined) return;
    this.#waiting.delete(n);
    this.#answered = this.#answered.filter((one) => at - one.at < WINDOW_MS);
    this.#answered.push({ at, trip: at - sentAt });
  }

  /** What the answers of the last ten seconds say; `null` without any. */
  ofLate(now: number): Latency | null {
    const trips = this.#answered
      .filter((one) => now - one.at < WINDOW_MS)
      .map((one) => one.trip)
      .sort((a, b) => a - b);
    const share = (part: number) =>
      trips[Math.min(Math.floor(part * trips.length), trips.length - 1)];
    const [p50, p95] = [share(0.5), share(0.95)];
    return p50 === undefined || p95 === undefined ? null : { answers: trips.length, p50, p95 };
  }
}
