/** The station's clock as far as the browser knows it; a demo may run it fast. */
export class StationClock {
  #stationMs = Date.now();
  #localMs = performance.now();
  speed = 1;

  /** Take over a time that the station just told. */
  set(stationMs: number, localMs: number): void {
    this.#stationMs = stationMs;
    this.#localMs = localMs;
  }

  /** Station time, ms since 1970, at a local `performance.now()`. */
  at(localMs: number): number {
    return this.#stationMs + (localMs - this.#localMs) * this.speed;
  }

  /** How much station time, s, passed since a local `performance.now()`. */
  since(localMs: number, now: number): number {
    return (Math.max(0, now - localMs) / 1000) * this.speed;
  }
}
