import type { Attachment } from 'svelte/attachments';

/**
 * Announces what scrolls sideways: an edge that goes on fades, and the keyboard can scroll it.
 *
 * @param label What it is, for people who hear the page.
 */
export function scrollRegion(label: string): Attachment<HTMLElement> {
  return (element) => {
    const tell = () => {
      const hidden = element.scrollWidth - element.clientWidth;
      const isWider = hidden > 1;
      element.classList.toggle('more-left', isWider && element.scrollLeft > 1);
      element.classList.toggle('more-right', isWider && element.scrollLeft < hidden - 1);
      const isLonger = element.scrollHeight > element.clientHeight + 1;
      for (const [name, value] of [
        ['tabindex', '0'],
        ['role', 'region'],
        ['aria-label', `${label}, goes on ${isWider ? 'sideways' : 'below'}`],
      ] as const) {
        if (isWider || isLonger) element.setAttribute(name, value);
        else element.removeAttribute(name);
      }
    };
    const sizes = new ResizeObserver(tell);
    sizes.observe(element);
    for (const child of element.children) sizes.observe(child);
    element.addEventListener('scroll', tell, { passive: true });
    tell();
    return () => {
      sizes.disconnect();
      element.removeEventListener('scroll', tell);
    };
  };
}
