import { describe, expect, test } from 'vitest';
import { inverted, multiplied, SceneCamera, type Ned } from './scene_camera';

const WATER = { x_min_m: 0, x_max_m: 400, y_min_m: -100, y_max_m: 400, depth_max_m: 20 };
const [WIDTH, HEIGHT] = [1000, 640];
const [NEAR, FAR] = [0.01, 1000];

/** Rows as they are written on paper, column by column as WebGL keeps them. */
const matrix = (rows: readonly (readonly number[])[]) =>
  [0, 1, 2, 3].flatMap((column) => rows.map((row) => row[column] ?? 0));

function perspective(depth: readonly [number, number]): number[] {
  const focal = 1.6;
  return matrix([
    [(focal * HEIGHT) / WIDTH, 0, 0, 0],
    [0, focal, 0, 0],
    [0, 0, ...depth],
    [0, 0, -1, 0],
  ]);
}

const DEPTHS = {
  plain: [-(FAR + NEAR) / (FAR - NEAR), (-2 * FAR * NEAR) / (FAR - NEAR)],
  reversed: [NEAR / (FAR - NEAR), (FAR * NEAR) / (FAR - NEAR)],
} as const;

/** A camera that looks north and down at a slope from 8 units south of the middle. */
function cameraOf(depth: keyof typeof DEPTHS, exaggeration = 8): SceneCamera {
  const [sin, cos] = [Math.sin(0.7), Math.cos(0.7)];
  const back = 8;
  // Rows: right (east), up, towards the viewer; the eye lies that far back along the last.
  const view = matrix([
    [1, 0, 0, 0],
    [0, sin, cos, 0],
    [0, -cos, sin, -back],
    [0, 0, 0, 1],
  ]);
  const perM = 10 / 500;
  const world = matrix([
    [1, 0, 0, -150 * perM],
    [0, 1, 0, -200 * perM],
    [0, 0, 1, 0],
    [0, 0, 0, 1],
  ]);
  const shown = multiplied(multiplied(perspective(DEPTHS[depth]), view), world);
  return new SceneCamera(shown, WIDTH, HEIGHT, WATER, exaggeration);
}

function place(): Ned {
  return [400 * Math.random(), -100 + 500 * Math.random(), 20 * Math.random()];
}

describe.each(['plain', 'reversed'] as const)('a camera with %s depths', (depth) => {
  const camera = cameraOf(depth);

  test('shows the middle of the water in the middle of the picture', () => {
    const at = camera.at([200, 150, 0]);
    expect(at?.x).toBeCloseTo(WIDTH / 2);
    expect(at?.y).toBeCloseTo(HEIGHT / 2);
  });

  test('finds every place again under its pixel, by its depth or its place', () => {
    for (let i = 0; i < 200; i++) {
      const [north, east, down] = place();
      const at = camera.at([north, east, down]);
      if (!at) throw new Error('it is in the picture');
      const level = camera.level(at, down);
      expect(level?.north).toBeCloseTo(north, 5);
      expect(level?.east).toBeCloseTo(east, 5);
      expect(camera.depth(at, north, east)).toBeCloseTo(down, 5);
    }
  });

  test('finds no place of the surface above the horizon, and shows none behind itself', () => {
    expect(camera.level({ x: WIDTH / 2, y: -5000 }, 0)).toBeNull();
    expect(camera.at([-2000, 150, 0])).toBeNull();
  });
});

test('what is drawn deeper lies lower', () => {
  const low = [1, 8].map((times) => cameraOf('plain', times).at([200, 150, 10])?.y ?? 0);
  expect(low[1]).toBeGreaterThan(low[0] ?? 0);
});

test('a matrix without an inverse has none', () => {
  expect(inverted(Array<number>(16).fill(1))).toBeNull();
});
