import type { Job, JsonObject, MapComparison, SceneView } from '../src/api/types';
import { COMPARED, fakeMap, MODELS, TITLES } from './field';
import { iso, type FakeRobot } from './robot';
import type { FakeStation } from './station';

type Answer = { status?: number; body?: unknown } | null;

const NEVER: MapComparison = {
  state: 'none',
  compared_at: null,
  samples: null,
  against: null,
  is_outdated: false,
  models: [],
};

/** The fake station's maps, their comparison, the learning of kernels, and the 3D view's state. */
export class FakeMaps {
  readonly #station: FakeStation;
  readonly #comparisons = new Map<string, MapComparison>();
  readonly #views = new Map<string, SceneView>();

  constructor(station: FakeStation) {
    this.#station = station;
  }

  ofRobot(
    robot: FakeRobot,
    variable: string,
    action: string,
    method: string,
    model: string,
  ): Answer {
    const now = this.#station.now();
    if (variable === '') {
      const { variable: key, title, unit } = fakeMap(robot, MODELS[0] ?? '', now);
      return {
        body: [
          {
            variable: key,
            title,
            unit,
            models: MODELS,
            titles: TITLES,
            samples: 1104,
            updated_at: iso(now),
          },
        ],
      };
    }
    if (action === 'comparison' && method === 'POST') return this.#compare(robot);
    if (action === 'comparison') return { body: this.#comparisons.get(robot.id) ?? NEVER };
    if (action === 'learning') return this.#learn();
    return { body: fakeMap(robot, model || (MODELS[0] ?? ''), now) };
  }

  view(robot: FakeRobot, change: JsonObject): Answer {
    const isLake = robot.site.kind === 'lake';
    const known = this.#views.get(robot.id) ?? newView(isLake);
    const { layers, ...other } = change as { layers?: Record<string, boolean> };
    const next: SceneView = {
      ...known,
      ...(other as Partial<SceneView>),
      layers: known.layers.map((layer) => ({
        ...layer,
        visible: layers?.[layer.key] ?? layer.visible,
      })),
    };
    this.#views.set(robot.id, next);
    return { body: next };
  }

  #compare(robot: FakeRobot): Answer {
    const job = this.#job('compare_maps', 'model 1 of 4', (done) => {
      this.#comparisons.set(robot.id, {
        state: done.state === 'done' ? 'ready' : 'none',
        compared_at: iso(this.#station.now()),
        samples: 1104,
        against: robot.site.kind === 'lake' ? 'held-out samples' : 'truth',
        is_outdated: false,
        models: COMPARED,
      });
    });
    this.#comparisons.set(robot.id, { ...NEVER, state: 'working', job });
    return { status: 202, body: { job } };
  }

  #learn(): Answer {
    const job = this.#job('learn_field', 'start 1 of 3', (done) => {
      done.result = {
        message: 'The kernels fit the samples better than before.',
        before_nll: 412.8,
        after_nll: 318.2,
        is_changed: true,
        kernels: [
          'Noise by position: length scales 1.74 m north, 1.92 m east, 0.84 m in depth; noise 0.049.',
        ],
      };
    });
    return { status: 202, body: { job } };
  }

  #job(kind: string, message: string, ondone: (job: Job) => void): string {
    const { jobs } = this.#station;
    const job: Job = {
      id: `job-${jobs.size + 1}`,
      kind,
      state: 'running',
      progress: 0,
      message,
      result: null,
      created_at: iso(this.#station.now()),
    };
    jobs.set(job.id, job);
    const timer = setInterval(() => {
      if (job.state === 'running') job.progress += 0.08;
      if (job.state === 'running' && job.progress < 1) return;
      clearInterval(timer);
      if (job.state === 'running') job.state = 'done';
      ondone(job);
    }, 250);
    return job.id;
  }
}

function newView(isLake: boolean): SceneView {
  const layers = [
    ['map', 'Map'],
    ['samples', 'Samples'],
    ['track', 'Track'],
    ['drift', 'Drift'],
    ['plan', 'Plan'],
    ['uncertainty', 'Planned uncertainty'],
    ['rehearsal', 'Rehearsed track'],
    ['keep_outs', 'Keep-outs'],
    ['floor', 'Shore and floor'],
    ['what_if', 'What-if'],
  ] as const;
  return {
    quantity: 'mean',
    form: 'volume',
    model: MODELS[0] ?? '',
    models: COMPARED.map(({ model, title }) => ({ key: model, title })),
    slice_depth: 0.4,
    slice_north: null,
    slice_east: null,
    opacity: 0.8,
    exaggeration: isLake ? 8 : 1,
    exaggeration_max: 40,
    layers: layers.map(([key, title]) => ({
      key,
      title,
      visible: key !== 'drift',
      has_content: key !== 'what_if',
    })),
    legend: isLake
      ? 'Chlorophyll: 0.7 (dark) to 5.6 µg/L'
      : 'Blue light: 60 (dark) to 1,200 counts',
    target_legend: isLake
      ? ''
      : 'Target. Orange dot in its ellipse: where the robot believes it, with 95 %; ring around the robot: newest range; white cross: true place of the virtual target.',
  };
}
