import { readFileSync } from 'node:fs';
import { describe, expect, test } from 'vitest';

const SHEET = readFileSync(new URL('./token.css', import.meta.url), 'utf8');

function tokens(theme: string): Record<string, string> {
  const block = new RegExp(`data-theme='${theme}'\\]\\s*\\{([^}]*)\\}`).exec(SHEET)?.[1] ?? '';
  const found = [...block.matchAll(/--([a-z0-9-]+):\s*(#[0-9a-f]{6})/g)];
  return Object.fromEntries(found.map(([, name = '', value = '']) => [name, value]));
}

function luminance(hex: string): number {
  const [red, green, blue] = [1, 3, 5].map((at) => {
    const share = parseInt(hex.slice(at, at + 2), 16) / 255;
    return share <= 0.04045 ? share / 12.92 : ((share + 0.055) / 1.055) ** 2.4;
  }) as [number, number, number];
  return 0.2126 * red + 0.7152 * green + 0.0722 * blue;
}

function contrast(a: string, b: string): number {
  const [bright, dark] = [luminance(a), luminance(b)].sort((x, y) => y - x) as [number, number];
  return (bright + 0.05) / (dark + 0.05);
}

const TEXTS = ['text', 'muted', 'accent', 'ok', 'watch', 'alarm', 'simulation'];
const GROUNDS = ['ground', 'panel', 'raised'];
const PAIRS = [
  ...TEXTS.flatMap((text) => GROUNDS.map((ground) => [text, ground] as const)),
  ['on-accent', 'accent'],
  ['on-alarm', 'alarm-fill'],
  ['on-alarm', 'alarm-held'],
  ['text', 'accent-wash'],
  ['text', 'watch-wash'],
  ['text', 'alarm-wash'],
  ['muted', 'watch-wash'],
  ['watch', 'watch-wash'],
  ['alarm', 'alarm-wash'],
] as const;

describe.each(['dark', 'day', 'night-red'])('the theme %s', (theme) => {
  const colours = tokens(theme);

  test.each(PAIRS)('has %s readable on %s', (text, ground) => {
    const [front = '', back = ''] = [colours[text], colours[ground]];
    expect(contrast(front, back)).toBeGreaterThanOrEqual(4.5);
  });

  test('has the lines of what-if runs visible on a panel', () => {
    for (let run = 0; run < 6; run++) {
      const colour = colours[`run-${run}`] ?? '';
      expect(contrast(colour, colours.panel ?? ''), `run ${run}`).toBeGreaterThanOrEqual(3);
    }
  });

  test('has marks on a map visible on any of its colours, by their edge or their halo', () => {
    const [edge = '', halo = ''] = [colours['mark-edge'], colours['mark-halo']];
    const greys = Array.from(
      { length: 256 },
      (_, i) => `#${i.toString(16).padStart(2, '0').repeat(3)}`,
    );
    for (const grey of greys) {
      expect(Math.max(contrast(edge, grey), contrast(halo, grey)), grey).toBeGreaterThanOrEqual(3);
    }
  });

  test('gives a colour to every role', () => {
    const roles = Object.keys(tokens('dark'));
    expect(roles.length).toBeGreaterThan(20);
    expect(Object.keys(colours)).toEqual(expect.arrayContaining(roles));
  });
});

test('night red has next to no blue', () => {
  for (const [name, value] of Object.entries(tokens('night-red'))) {
    const [red, blue] = [parseInt(value.slice(1, 3), 16), parseInt(value.slice(5, 7), 16)];
    expect(blue, name).toBeLessThanOrEqual(Math.max(red * 0.72, 1));
  }
});
