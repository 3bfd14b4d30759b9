import type { Cursor } from '../live/cursor.svelte';
import type { Preference } from '../live/preference.svelte';
import type { Station } from '../live/station.svelte';
import { parseRoute, routePath, type PageKey, type Route } from './route';

/** Where in the app its user is: the page, and the robot that every page speaks of. */
export class Place {
  #route = $state.raw<Route>(here());
  readonly #station: Station;
  readonly #preference: Preference;

  readonly #cursor: Cursor;

  constructor(station: Station, preference: Preference, cursor: Cursor) {
    this.#cursor = cursor;
    this.#station = station;
    this.#preference = preference;
  }

  readonly page = $derived(this.#route.page);
  readonly section = $derived(this.#route.section);
  /** Robot of the address, else the one looked at last, else the first. */
  readonly robot = $derived.by(() => {
    const known = this.#station.robots.map(({ id }) => id);
    const wished = [this.#route.robot, this.#preference.robot];
    return wished.find((id) => id !== null && known.includes(id)) ?? known[0] ?? null;
  });

  path(page: PageKey, robot: string | null = this.robot, section = ''): string {
    return routePath(page, robot, section);
  }

  /** A page of a robot as of a moment. */
  pathAt(page: PageKey, robot: string, at: string): string {
    return `${routePath(page, robot)}?at=${encodeURIComponent(at)}`;
  }

  /** End the replay. */
  returnToNow(): void {
    this.#cursor.goLive();
    this.go(this.page, this.robot, this.section);
  }

  /** Replay the robot in hand from a moment on, ms since 1970. */
  replay(at: number): void {
    this.#cursor.seek(at);
    this.go(this.page, this.robot, this.section);
  }

  /** Let the address say where the cursor is; back and forward skip where it was meanwhile. */
  noteCursor(): void {
    const address = `${location.pathname}${this.#cursor.search()}${location.hash}`;
    if (address !== location.pathname + location.search + location.hash) {
      history.replaceState(history.state, '', address);
    }
  }

  /** Another page at the same moment: a replay goes on until somebody ends it. */
  go(page: PageKey, robot: string | null = this.robot, section = ''): void {
    if (robot !== null) this.#preference.robot = robot;
    const [path, hash] = routePath(page, robot, section).split('#');
    const address = `${path}${this.#cursor.search()}${hash === undefined ? '' : `#${hash}`}`;
    if (address !== location.pathname + location.search + location.hash) {
      history.pushState(null, '', address);
    }
    this.#route = here();
  }

  /** Another robot on the same part of the same page. */
  choose(robot: string): void {
    this.go(this.page, robot, this.section);
  }

  open(section: string): void {
    this.go(this.page, this.robot, section);
  }

  /** The robot `step` places further in the list, round its ends. */
  chooseBeside(step: number): void {
    const ids = this.#station.robots.map(({ id }) => id);
    if (ids.length === 0) return;
    const here = Math.max(0, ids.indexOf(this.robot ?? ''));
    const next = ids[(here + step + ids.length) % ids.length];
    if (next !== undefined) this.choose(next);
  }

  /** Follow the browser's back and forward, and links inside the app. */
  listen(): () => void {
    const onBack = () => {
      this.#cursor.take(location.search);
      this.#route = here();
    };
    const onClick = (event: MouseEvent) => this.#follow(event);
    addEventListener('popstate', onBack);
    document.addEventListener('click', onClick);
    return () => {
      removeEventListener('popstate', onBack);
      document.removeEventListener('click', onClick);
    };
  }

  #follow(event: MouseEvent): void {
    if (event.defaultPrevented || event.button !== 0) return;
    if (event.metaKey || event.ctrlKey || event.shiftKey || event.altKey) return;
    const link = event.target instanceof Element ? event.target.closest('a') : null;
    if (!link?.hasAttribute('data-in-app')) return;
    event.preventDefault();
    const { page, robot, section, at } = parseRoute(link.pathname, link.hash, link.search);
    if (at !== null) this.#cursor.take(link.search);
    this.go(page, robot ?? this.robot, section);
  }
}

function here(): Route {
  return parseRoute(location.pathname, location.hash, location.search);
}
