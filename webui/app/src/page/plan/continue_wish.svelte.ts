/** Whether surveys go on by themselves once their plan is sent: what was said last of each robot. */

const KEY = 'grace continue by itself';

/** Kept as long as the browser's tab, so that a page that is opened again asks nothing anew. */
export class ContinueWish {
  readonly #said = $state<Record<string, boolean>>(kept());

  /** A survey continues by itself unless somebody said no. */
  of(robot: string): boolean {
    return this.#said[robot] ?? true;
  }

  say(robot: string, wanted: boolean): void {
    this.#said[robot] = wanted;
    try {
      sessionStorage.setItem(KEY, JSON.stringify(this.#said));
    } catch {
      // A browser without storage forgets it with the page.
    }
  }
}

function kept(): Record<string, boolean> {
  try {
    const said: unknown = JSON.parse(sessionStorage.getItem(KEY) ?? '{}');
    if (typeof said !== 'object' || said === null) return {};
    return Object.fromEntries(
      Object.entries(said).filter(
        (entry): entry is [string, boolean] => typeof entry[1] === 'boolean',
      ),
    );
  } catch {
    return {};
  }
}
