import { shadeColours } from './plot';

/** Figures as files: SVG and PNG in the colours of paper, tables as CSV. */

const SVG = 'http://www.w3.org/2000/svg';
/** Dots of a picture to one of the screen. */
const DENSITY = 2;
const FONT = 'Inter, Helvetica, Arial, sans-serif';

/** A text whose `var(--name)` stand for themselves, for programs that know no such thing. */
export function withColours(text: string, colours: Readonly<Record<string, string>>): string {
  return text.replaceAll(/var\((--[\w-]+)\)/g, (whole, name: string) => colours[name] ?? whole);
}

/** Colours of the day theme, which is that of paper. */
function dayColours(): Record<string, string> {
  const found: Record<string, string> = {};
  for (const sheet of document.styleSheets) {
    for (const rule of sheet.cssRules) {
      if (!(rule instanceof CSSStyleRule) || !/data-theme=["']?day\b/.test(rule.selectorText))
        continue;
      for (const name of rule.style) {
        if (name.startsWith('--')) found[name] = rule.style.getPropertyValue(name).trim();
      }
    }
  }
  shadeColours(false).forEach((colour, shade) => (found[`--shade-${shade}`] = colour));
  return found;
}

/** A figure as a file of its own. */
export function svgText(figure: SVGSVGElement): string {
  const { width, height } = figure.getBoundingClientRect();
  const copy = figure.cloneNode(true) as SVGSVGElement;
  for (const each of copy.querySelectorAll('[data-screen]')) each.remove();
  copy.removeAttribute('class');
  copy.removeAttribute('style');
  copy.setAttribute('xmlns', SVG);
  copy.setAttribute('viewBox', `0 0 ${width} ${height}`);
  copy.setAttribute('width', String(width));
  copy.setAttribute('height', String(height));
  copy.setAttribute('font-family', FONT);
  const paper = document.createElementNS(SVG, 'rect');
  paper.setAttribute('width', '100%');
  paper.setAttribute('height', '100%');
  paper.setAttribute('fill', 'var(--panel)');
  copy.prepend(paper);
  return withColours(new XMLSerializer().serializeToString(copy), dayColours());
}

export async function pngOf(svg: string): Promise<Blob> {
  const picture = new Image();
  picture.src = `data:image/svg+xml;charset=utf-8,${encodeURIComponent(svg)}`;
  await picture.decode();
  const canvas = document.createElement('canvas');
  canvas.width = picture.naturalWidth * DENSITY;
  canvas.height = picture.naturalHeight * DENSITY;
  canvas.getContext('2d')?.drawImage(picture, 0, 0, canvas.width, canvas.height);
  return new Promise((done, fail) => {
    canvas.toBlob((blob) => {
      if (blob) done(blob);
      else fail(new Error('This browser could not draw the picture; save it as SVG.'));
    }, 'image/png');
  });
}

export type Cell = string | number | null;

/** A table with remarks above it; nothing stands for what nobody knows. */
export function csvText(
  remarks: readonly string[],
  head: readonly string[],
  rows: readonly (readonly Cell[])[],
): string {
  const cell = (value: Cell): string => {
    const text = String(value ?? '');
    return /[",\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text;
  };
  return [
    ...remarks.map((one) => `# ${one}`),
    ...[head, ...rows].map((row) => row.map(cell).join(',')),
  ]
    .map((line) => `${line}\n`)
    .join('');
}

/** Give somebody a file. */
export function offer(name: string, content: Blob): void {
  const link = document.createElement('a');
  link.href = URL.createObjectURL(content);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
}
