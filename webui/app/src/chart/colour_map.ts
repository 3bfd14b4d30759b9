/** Perceptually uniform colour maps; evenly spaced stops, mixed in between. */

const STOPS = {
  viridis: '440154 482878 3e4989 31688e 26828e 1f9e89 35b779 6dcd59 b4de2c fde725',
  magma: '000004 180f3e 451077 721f81 9f2f7f cd4071 f1605d fd9567 fec98d fcfdbf',
  cividis: '00224e 123570 3b496c 575d6d 707173 8a8779 a69d75 c4b56c e4cf5b fee838',
} as const;

/** Colours between edges, for a probability: one more than edges, each ahead of its edge. */
const PROBABILITY = { colours: '00224e 575d6d bcae6c fee838', edges: [0.05, 0.5, 0.95] } as const;

/** The same, for a key. */
export const probabilityColours = PROBABILITY.colours.split(' ').map((hex) => `#${hex}`);

export type ColourMapName = keyof typeof STOPS | 'probability';

/** Colours of a map, 256 x RGB. */
export function colourTable(name: ColourMapName): Uint8ClampedArray {
  if (name === 'probability') return probabilityTable();
  const stops = STOPS[name].split(' ').map(channels);
  const table = new Uint8ClampedArray(256 * 3);
  for (let i = 0; i < 256; i++) {
    const place = (i / 255) * (stops.length - 1);
    const low = Math.min(Math.floor(place), stops.length - 2);
    for (let c = 0; c < 3; c++) {
      const from = stops[low]?.[c] ?? 0;
      const to = stops[low + 1]?.[c] ?? 0;
      table[i * 3 + c] = from + (to - from) * (place - low);
    }
  }
  return table;
}

function probabilityTable(): Uint8ClampedArray {
  const colours = PROBABILITY.colours.split(' ').map(channels);
  const table = new Uint8ClampedArray(256 * 3);
  for (let i = 0; i < 256; i++) {
    const step = PROBABILITY.edges.filter((edge) => i / 255 >= edge).length;
    table.set(colours[step] ?? [], i * 3);
  }
  return table;
}

/** Index into a table of 256 colours; values outside take the end colours. */
export function tableIndex(value: number, low: number, high: number): number {
  if (high <= low) return 128;
  return Math.max(0, Math.min(255, Math.round(((value - low) / (high - low)) * 255)));
}

function channels(hex: string): number[] {
  return [0, 2, 4].map((at) => parseInt(hex.slice(at, at + 2), 16));
}
