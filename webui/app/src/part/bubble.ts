const GAP_PX = 6;

/** Open a popover over everything else, under what it belongs to, and inside of the window. */
export function openBubble(bubble: HTMLElement): void {
  const anchor = bubble.parentElement?.getBoundingClientRect();
  if (!anchor) return;
  bubble.showPopover();
  const { width, height } = bubble.getBoundingClientRect();
  const left = Math.min(anchor.left, innerWidth - width - GAP_PX);
  const isLow = anchor.bottom + GAP_PX + height > innerHeight;
  bubble.style.left = `${Math.max(GAP_PX, left)}px`;
  bubble.style.top = `${isLow ? anchor.top - GAP_PX - height : anchor.bottom + GAP_PX}px`;
}
