import type { ControllerWish, Identification, Job, JsonObject, WhatIf } from '../src/api/types';
import { fakeComparison, fakeIdentification, fakePolar, steady } from './motion';
import { iso } from './robot';
import type { FakeStation } from './station';

const STEP_MS = 250;
const ITERATIONS = 60;

type Answer = { status?: number; body?: unknown } | null;

function refused(status: number, detail: string, errors: unknown[] = []): Answer {
  return { status, body: { type: 'about:blank', title: 'Refused', status, detail, errors } };
}

/** The fake station's vehicles, what-if runs, identifications and advice on trim. */
export class FakeControl {
  readonly #station: FakeStation;
  #whatIfs: WhatIf[] = [];
  #identifications: Identification[] = [];

  constructor(station: FakeStation) {
    this.#station = station;
  }

  vehicles(key: string, part: string, query: URLSearchParams): Answer {
    if (part === 'capability') {
      return {
        body: {
          primitives: { glide_angle_rad: 0.82, glide_speed_m_s: 0.024 },
          energy: { dive: 1.2 },
        },
      };
    }
    if (part === 'polar') {
      const note = /grace/i.test(key) ? 'Scaled, not identified.' : '';
      return { body: fakePolar(key, /grace/i.test(key) ? 'GRACE 3' : 'Miniglider', note) };
    }
    const number = (name: string) => Number(query.get(name) ?? 0);
    const motion = steady(number('m0_kg'), number('rp1_m'), number('delta_rad'));
    if (motion) return { body: motion };
    return refused(422, 'With these inputs the vehicle has no steady motion.');
  }

  ofRobot(robot: string, part: string, item: string, body: JsonObject): Answer {
    if (part === 'whatif' && item === 'shown') {
      this.#whatIfs.forEach((run) => (run.shown = run.id === body.id));
      return { body: {} };
    }
    if (part === 'whatif') return this.#startWhatIf(robot, body);
    if (part === 'whatifs') {
      return {
        body: { whatifs: this.#whatIfs },
      };
    }
    if (part === 'identifications' && Object.keys(body).length === 0) {
      return { body: { identifications: this.#identifications } };
    }
    if (part === 'identifications') return this.#identify(robot, body);
    if (part === 'trim' && item === 'advice') return { status: 202, body: { job: this.#advise() } };
    if (part === 'trim') return this.#acceptTrim(robot, body.share === 1 ? 1 : 0.5);
    return null;
  }

  whatIf(id: string): Answer {
    return { body: this.#whatIfs.find((each) => each.id === id) };
  }

  identification(id: string, action: string): Answer {
    const found = this.#identifications.find((each) => each.id === id);
    if (!found) return null;
    if (action === 'cancel') found.state = 'cancelled';
    if (action === 'resume') this.#converge(found);
    if (action === 'accept') found.vehicle = 'miniglider-1';
    return { body: action === 'accept' ? { vehicle: found.vehicle } : found };
  }

  #job(kind: string, onstep: (job: Job) => void, ondone: (job: Job) => void): Job {
    const jobs = this.#station.jobs;
    const created_at = iso(this.#station.now());
    const job: Job = {
      id: `job-${jobs.size + 1}`, kind, state: 'running', progress: 0, message: '', result: null,
      created_at,
    }; // prettier-ignore
    jobs.set(job.id, job);
    const timer = setInterval(() => {
      if (job.state === 'running') job.progress = Math.min(1, job.progress + 0.05);
      onstep(job);
      if (job.state === 'running' && job.progress < 1) return;
      clearInterval(timer);
      if (job.state === 'running') job.state = 'done';
      ondone(job);
    }, STEP_MS);
    return job;
  }

  #startWhatIf(robot: string, body: JsonObject): Answer {
    const scenario = body.scenario as JsonObject;
    if (Number(scenario.duration_s) > 5000) {
      return refused(
        422,
        'The reference leaves the water: its depth ends at 250 m, the site at 0.7 m.',
        [{ loc: ['body', 'scenario', 'duration_s'], msg: 'The reference leaves the water.' }],
      );
    }
    const controllers = body.controllers as unknown as ControllerWish[];
    const seeds = Number(scenario.runs ?? 1) * controllers.length;
    const run: WhatIf = {
      id: `whatif-${this.#whatIfs.length + 1}`, robot, state: 'running', scenario, controllers,
      result: null, created_at: iso(this.#station.now()), created_by: 'anna', job: null,
      title: controllers.map(({ title, kind }) => title ?? kind).join(', '), shown: false, message: '',
    }; // prettier-ignore
    const step = (job: Job) => {
      job.message = `${Math.round(job.progress * seeds)} of ${seeds} runs`;
    };
    const job = this.#job('whatif', step, ({ state }) => {
      run.state = state === 'done' ? 'done' : 'cancelled';
      run.result =
        state === 'done' ? fakeComparison(controllers, Number(scenario.duration_s)) : null;
    });
    run.job = job.id;
    this.#whatIfs.unshift(run);
    return { status: 202, body: { id: run.id, job: job.id } };
  }

  #identify(robot: string, body: JsonObject): Answer {
    const found: Identification = {
      id: `identification-${this.#identifications.length + 1}`, robot,
      deployment: JSON.stringify(body.deployment).slice(1, -1), state: 'running', config: body.config as JsonObject,
      progress: 0, message: '', convergence: [], result: null, vehicle: null,
      created_at: iso(this.#station.now()), created_by: 'anna', job: null,
      has_checkpoint: true, data_start_at: iso(this.#station.started - 3_600_000),
    }; // prettier-ignore
    this.#identifications.unshift(found);
    this.#converge(found);
    return { status: 202, body: { id: found.id, job: 'job-0' } };
  }

  #converge(found: Identification): void {
    found.state = 'running';
    const timer = setInterval(() => {
      if (found.state !== 'running') return clearInterval(timer);
      const iteration = found.convergence.length;
      const cost = 4 * Math.exp(-iteration / 9) + 0.018 + 0.01 * Math.cos(iteration / 3) ** 2;
      found.convergence = [...found.convergence, { iteration, cost }];
      found.progress = iteration / ITERATIONS;
      found.message = `iteration ${iteration} of ${ITERATIONS}, best cost ${cost.toFixed(4)}`;
      if (iteration < ITERATIONS) return;
      found.state = 'done';
      found.result = fakeIdentification([...found.convergence]);
    }, STEP_MS);
  }

  #advise(): string {
    const ondone = (job: Job) => {
      job.result = {
        id: 'advice-1', present: { net_buoyancy_offset_kg: 0, mass_position_offset_m: 0 }, dives: 4, net_buoyancy_offset_kg: -0.0042, net_buoyancy_std_kg: 0.0006,
        mass_position_offset_m: 0.0011, mass_position_std_m: 0.0002,
        rmse_now: { depth_rate_m_s: 0.0061, pitch_rad: 0.041 },
        rmse_proposed: { depth_rate_m_s: 0.0018, pitch_rad: 0.012 },
        half_step: { net_buoyancy_offset_kg: -0.0021, mass_position_offset_m: 0.00055 },
        full_step: { net_buoyancy_offset_kg: -0.0042, mass_position_offset_m: 0.0011 },
        message: 'The robot is about 4 g heavy and its mass stands 1 mm too far back.',
        is_worth_it: true,
      }; // prettier-ignore
    };
    return this.#job('trim', (job) => (job.message = 'reading steady glides'), ondone).id;
  }

  #acceptTrim(robot: string, share: number): Answer {
    this.#station.patch('trim', robot, {
      net_buoyancy_offset_kg: -0.0042 * share,
      mass_position_offset_m: 0.0011 * share,
    });
    return {
      body: {
        config_id: 'config-9',
        net_buoyancy_offset_kg: -0.0042 * share,
        mass_position_offset_m: 0.0011 * share,
        reaches_robot: `It goes to ${robot} with its next plan.`,
      },
    };
  }
}
