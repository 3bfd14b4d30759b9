const KEY = 'grace.contact';
const EVERY_MS = 5000;

/** When this browser last heard the station, kept for the page that opens without it. */
export class LastContact {
  #notedAt = -Infinity;

  /** Note that the station is heard now, by this device's clock; at most every five seconds. */
  note(now: number = Date.now()): void {
    if (Math.abs(now - this.#notedAt) < EVERY_MS) return;
    this.#notedAt = now;
    try {
      localStorage.setItem(KEY, new Date(now).toISOString());
    } catch {
      // A browser that stores nothing says later that it does not know.
    }
  }

  /** Milliseconds since 1970; `null` where that is not known. */
  static kept(): number | null {
    try {
      const at = Date.parse(localStorage.getItem(KEY) ?? '');
      return Number.isNaN(at) ? null : at;
    } catch {
      return null;
    }
  }
}
