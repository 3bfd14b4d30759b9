import type { SoundKind } from './sound_pattern';

/** What the icons of the tab and of the installed app say. */
export interface Badge {
  /** Alarms that nobody has acknowledged; `null` while the station is not heard. */
  count: number | null;
  /** The gravest of them that sounds. */
  kind: SoundKind | null;
}

export const PLAIN_ICON = '/mark.svg';
const SIZE = 64;
const MOST = 99;

/** What the badge says; empty for none. */
export function badgeText({ count }: Badge): string {
  if (count === null) return '?';
  return count === 0 ? '' : count > MOST ? `${MOST}+` : `${count}`;
}

/** Roles of the badge's ground and of its figures, by severity. */
export function badgeRoles({ count, kind }: Badge): readonly [string, string] {
  if (count === null || kind === null) return ['--line-strong', '--on-alarm'];
  if (kind === 'critical' || kind === 'severe') return ['--alarm-fill', '--on-alarm'];
  return ['--watch', '--watch-wash'];
}

/** Draws the badge into the icon of the tab, and tells the installed app where there is one. */
export class IconBadge {
  #mark: Promise<HTMLImageElement | null> | undefined;
  #newest = 0;

  async show(badge: Badge): Promise<void> {
    void this.#tellApp(badge);
    const turn = ++this.#newest;
    const mark = badgeText(badge) === '' ? null : await (this.#mark ??= loaded(PLAIN_ICON));
    if (turn !== this.#newest) return;
    const link = document.querySelector<HTMLLinkElement>('link[rel="icon"]');
    if (!link) return;
    const drawn = badgeText(badge) === '' ? null : icon(badge, mark);
    link.type = drawn === null ? 'image/svg+xml' : 'image/png';
    link.href = drawn ?? PLAIN_ICON;
  }

  async #tellApp({ count }: Badge): Promise<void> {
    if (!('setAppBadge' in navigator)) return;
    try {
      if (count === 0) await navigator.clearAppBadge();
      else await navigator.setAppBadge(...(count === null ? [] : [count]));
    } catch {
      // A browser may refuse it to a page that is not installed; the tab says the same.
    }
  }
}

async function loaded(address: string): Promise<HTMLImageElement | null> {
  const image = new Image(SIZE, SIZE);
  image.src = address;
  try {
    await image.decode();
    return image;
  } catch {
    return null; // the count matters more than the mark under it
  }
}

function icon(badge: Badge, mark: HTMLImageElement | null): string | null {
  const canvas = document.createElement('canvas');
  canvas.width = canvas.height = SIZE;
  const context = canvas.getContext('2d');
  if (!context) return null;
  if (mark) context.drawImage(mark, 0, 0, SIZE, SIZE);
  const style = getComputedStyle(document.documentElement);
  const [ground, figures] = badgeRoles(badge).map((role) => style.getPropertyValue(role).trim());
  const text = badgeText(badge);
  const [height, width] = [40, text.length === 1 ? 40 : text.length === 2 ? 54 : SIZE];
  context.fillStyle = ground ?? '';
  context.beginPath();
  context.roundRect(SIZE - width, 0, width, height, height / 2);
  context.fill();
  context.fillStyle = figures ?? '';
  context.font = `700 ${text.length > 2 ? 28 : 36}px system-ui, sans-serif`;
  context.textAlign = 'center';
  context.textBaseline = 'middle';
  context.fillText(text, SIZE - width / 2, height / 2 + 2);
  return canvas.toDataURL('image/png');
}
