import type { Snippet } from 'svelte';

/**
 * Keeps one 3D view for all pages.
 *
 * A frame reloads when it moves in the document, so the view stays where it is and is laid over the
 * place that the page in sight has kept free for it.
 */
export class SceneStage {
  /** Rectangle inside the scrolling area, px; `null` while no page shows the view. */
  rectangle = $state.raw<{ x: number; y: number; width: number; height: number } | null>(null);
  /** Grows when the view is to be opened anew, with the camera where it was at first. */
  tries = $state(0);
  /** Drawn over the view while a page shows something of its own in it. */
  overlay = $state.raw<Snippet<[HTMLIFrameElement]> | null>(null);
  #owner: HTMLElement | null = null;

  /** Claim the view for an element and follow it; returns the release. */
  claim(place: HTMLElement, area: HTMLElement): () => void {
    this.#owner = place;
    const measure = () => {
      if (this.#owner !== place) return;
      const inner = place.getBoundingClientRect();
      const outer = area.getBoundingClientRect();
      const next = {
        x: Math.round(inner.left - outer.left + area.scrollLeft),
        y: Math.round(inner.top - outer.top + area.scrollTop),
        width: Math.round(inner.width),
        height: Math.round(inner.height),
      };
      const now = this.rectangle;
      const isSame =
        now?.x === next.x &&
        now.y === next.y &&
        now.width === next.width &&
        now.height === next.height;
      if (!isSame) this.rectangle = next;
    };
    const observer = new ResizeObserver(measure);
    observer.observe(place);
    // What lies above can shift the place without resizing it.
    const timer = setInterval(measure, 200);
    measure();
    return () => {
      observer.disconnect();
      clearInterval(timer);
      if (this.#owner !== place) return;
      this.#owner = null;
      this.rectangle = null;
    };
  }
}
