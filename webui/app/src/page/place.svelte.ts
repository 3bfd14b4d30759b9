import type { Preference } from '../live/preference.svelte';
import type { Station } from '../live/station.svelte';
import { parseRoute, routePath, type PageKey, type Route } from './route';

/** Where in the app its user is: the page, and the robot that every page speaks of. */
export class Place {
  #route = $state.raw<Route>(here());
  readonly #station: Station;
  readonly #preference: Preference;

  constructor(station: Station, preference: Preference) {
    this.#station = station;
    this.#preference = preference;
  }

  readonly page = $derived(this.#route.page);
  readonly section = $derived(this.#route.section);
  /** Moment that the page is opened at; `null` for now. */
  readonly at = $derived(this.#route.at);

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

  /** Leave the moment that the page was opened at. */
  returnToNow(): void {
    this.go(this.page, this.robot, this.section);
  }

  go(
    page: PageKey,
    robot: string | null = this.robot,
    section = '',
    at: string | null = null,
  ): void {
    if (robot !== null) this.#preference.robot = robot;
    const search = at === null ? '' : `?at=${encodeURIComponent(at)}`;
    const [path, hash] = routePath(page, robot, section).split('#');
    const address = `${path}${search}${hash === undefined ? '' : `#${hash}`}`;
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
    const onBack = () => (this.#route = here());
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
    this.go(page, robot ?? this.robot, section, at);
  }
}

function here(): Route {
  return parseRoute(location.pathname, location.hash, location.search);
}
