import type { GridKind } from '../chart/graticule';
import type { PositionFormat } from '../text/position';

export type Theme = 'dark' | 'day' | 'night-red';

/** A site in space, or flat from above. */
export type View = 'scene' | 'above';

export const THEMES: readonly { key: Theme; title: string; help: string }[] = [
  { key: 'dark', title: 'Dark', help: 'For a control room.' },
  { key: 'day', title: 'Day', help: 'For bright surroundings.' },
  { key: 'night-red', title: 'Night red', help: 'Keeps eyes adapted to the dark on deck.' },
];

const KEY = 'grace.preference';

/** What this browser remembers of its user's wishes. */
export class Preference {
  #theme = $state<Theme>('dark');
  position = $state<PositionFormat>('degrees');
  robot = $state<string | null>(null);
  /** What a view of a site shows; `null` before anybody chose. */
  view = $state<View | null>(null);
  /** Layers that maps leave out. */
  hiddenLayers = $state.raw<readonly string[]>([]);
  /** Lines of maps; `null` before anybody chose. */
  grid = $state<GridKind | null>(null);
  /** Picture under maps: the id of one, empty for none, `null` for the first that reaches there. */
  baseMap = $state<string | null>(null);
  /** Names of the people who were offered the tour and began or declined it. */
  toured = $state.raw<readonly string[]>([]);

  constructor() {
    const kept = read();
    if (THEMES.some(({ key }) => key === kept.theme)) this.theme = kept.theme as Theme;
    if (kept.position === 'minutes' || kept.position === 'seconds') this.position = kept.position;
    if (kept.view === 'scene' || kept.view === 'above') this.view = kept.view;
    if (typeof kept.robot === 'string') this.robot = kept.robot;
    if (typeof kept.baseMap === 'string') this.baseMap = kept.baseMap;
    if (kept.grid === 'geographic' || kept.grid === 'metres' || kept.grid === 'none') {
      this.grid = kept.grid;
    }
    this.hiddenLayers = texts(kept.hiddenLayers);
    this.toured = texts(kept.toured);
    document.documentElement.dataset.theme = this.theme;
  }

  get theme(): Theme {
    return this.#theme;
  }

  /** The page wears it before anybody hears of it: charts read its colours when they do. */
  set theme(theme: Theme) {
    document.documentElement.dataset.theme = theme;
    this.#theme = theme;
  }

  /** To be called inside an effect: keeps every change. */
  keep(): void {
    const kept = JSON.stringify({
      theme: this.theme,
      position: this.position,
      robot: this.robot,
      view: this.view,
      hiddenLayers: this.hiddenLayers,
      grid: this.grid,
      baseMap: this.baseMap,
      toured: this.toured,
    });
    try {
      localStorage.setItem(KEY, kept);
    } catch {
      // A browser that stores nothing still works; it forgets.
    }
  }
}

function texts(kept: unknown): string[] {
  return Array.isArray(kept) ? kept.filter((one) => typeof one === 'string') : [];
}

function read(): Record<string, unknown> {
  try {
    const kept: unknown = JSON.parse(localStorage.getItem(KEY) ?? '{}');
    return typeof kept === 'object' && kept !== null ? (kept as Record<string, unknown>) : {};
  } catch {
    return {};
  }
}
