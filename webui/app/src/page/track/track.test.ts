import { describe, expect, test } from 'vitest';
import type { JsonObject, TargetReport } from '../../api/types';
import { merged } from '../../live/track_history.svelte';
import {
  determinantLevel,
  guessOf,
  isNeeded,
  isTeaching,
  keeperOf,
  orbitRadius,
  targetName,
} from './config';
import { batteryText, trackFacts } from './account';
import { barrierSentence, knowable, knowableFigure, lately, observability } from './observability';
import { advice, isAstray, isFollowing, isVague, phaseSince, phaseWord } from './phase';
import { isTeachingNow } from './teaching';
import { pingOrders } from './ping';
import { distanceOf, rangeOrigin, trackColumns } from './series';

const START = Date.parse('2026-11-21T04:00:00Z');

function report(second: number, more: Partial<TargetReport> = {}): TargetReport {
  const at = new Date(START + second * 1000).toISOString();
  return {
    measured_at: at,
    received_at: at,
    phase: 'tracking',
    position_ne_m: [second, 0],
    hypotheses: [
      {
        position_ne_m: [second + 3, 4],
        velocity_ne_m_s: [0, 0],
        covariance_m2: [0.01, 0, 0.01],
        weight: 1,
      },
    ],
    range_m: 5,
    range_age_s: 0.2,
    ranges_heard: 10,
    ranges_rejected: 1,
    determinant_m2_s: -0.1,
    barrier: 0.02,
    inverse_condition: 0.5,
    nominal: [1, 0],
    command: [0.5, 0],
    is_barrier_on: true,
    is_feasible: true,
    is_quiet: false,
    true_ne_m: null,
    is_too_fast: false,
    speed_class: 'slow',
    delay_s: 0.1,
    error_m: null,
    reason: '',
    text: '',
    ...more,
  };
}

const CONFIG: JsonObject = {
  target: { kind: 'virtual', path: 'circle', speed_m_s: 0.01, width_m: 0.3, north_m: 1.4, east_m: 0.7, guess_std_m: 0.35, address: 10 },
  ranging: { lost_after_s: 15, give_up_after_s: 120 },
  barrier: { controller: 'barrier', epsilon: 0.04 },
  motion: { turn_rate_max_rad_s: Math.PI / 4 },
}; // prettier-ignore

function changed(group: string, fields: JsonObject): JsonObject {
  return { ...CONFIG, [group]: { ...(CONFIG[group] as JsonObject), ...fields } };
}

const PATIENCE = { lostAfterS: 15, giveUpAfterS: 120 };

describe('the hold on a target', () => {
  test('says in words what a person can do about it', () => {
    expect(advice(report(0), PATIENCE)).toBe('Nothing to do.');
    const low = report(0, { determinant_m2_s: 0.1 });
    expect(advice(low, PATIENCE, 0.2)).toBe('Nothing to do.');
    expect(advice(low, PATIENCE, 0.2, { determinant: 0.1, grows: true })).toContain(
      'bends its course',
    );
    expect(advice(report(0, { phase: 'coasting' }), PATIENCE)).toContain('after 15 s of silence');
    expect(advice(report(0, { phase: 'lost' }), PATIENCE)).toContain('Gives up 2 min 00 s after');
  });

  test('says of a robot that it teaches only while it follows its target', () => {
    expect(isTeachingNow(report(0, { is_barrier_on: false }))).toBe(true);
    expect(isTeachingNow(report(0, { is_barrier_on: false, phase: 'ended' }))).toBe(false);
    expect(isTeachingNow(report(0))).toBe(false);
    expect(isTeachingNow(null)).toBe(false);
  });
  test('never promises a search in the teaching mode, where there is none', () => {
    const lost = report(0, { phase: 'lost', is_barrier_on: false });
    expect(advice(lost, PATIENCE)).toContain('does not search');
  });

  test('names the order that ends a silence which a person ordered', () => {
    for (const phase of ['waiting', 'coasting', 'lost'] as const) {
      expect(advice(report(0, { phase, is_quiet: true }), PATIENCE)).toContain('“Ping again”');
    }
  });

  test('is as old as the newest change of phase', () => {
    const reports = [
      report(0),
      report(1, { phase: 'lost' }),
      report(2, { phase: 'lost' }),
      report(3),
      report(4),
    ];
    expect(phaseSince(reports)).toEqual({ at: reports[3]?.measured_at, isAtLeast: false });
    expect(phaseSince(reports.slice(3))).toEqual({
      at: reports[3]?.measured_at,
      isAtLeast: true,
    });
    expect(phaseSince([])).toBeNull();
  });

  test('that leaves its side open is not called a hold', () => {
    const near = report(0, { position_ne_m: [0, 0] });
    const [best] = near.hypotheses;
    if (!best) throw new Error('no hypothesis');
    const at = (std_m: number): TargetReport => ({
      ...near,
      hypotheses: [{ ...best, position_ne_m: [1, 0], covariance_m2: [std_m ** 2, 0, 0.01] }],
    });
    expect(isVague(at(0.2))).toBe(false);
    expect(isVague(at(0.5))).toBe(true);
    expect(phaseWord('tracking', false, false, true).tone).toBe('watch');
    expect(phaseWord('lost', false, false, true).text).toBe('Lost its target');
  });

  test('that is known to be wrong is not called a hold', () => {
    const wrong = report(0, { error_m: 2 });
    expect(isAstray(wrong)).toBe(true);
    expect(phaseWord('tracking', true)).toMatchObject({
      text: 'Believes it has its target',
      tone: 'watch',
    });
    expect(isAstray(report(0, { error_m: 0.2 }))).toBe(false);
    expect(isAstray(report(0, { error_m: null }))).toBe(false);
    expect(phaseWord('lost', true).text).toBe('Lost its target');
    expect(phaseWord('tracking', false, true).text).toBe('Target too fast to follow');
    expect(phaseWord('lost', false, true).text).toBe('Lost its target');
  });

  test('is nothing to tell of once it has ended', () => {
    expect(isFollowing({ tracking: report(0) })).toBe(true);
    expect(isFollowing({ tracking: report(0, { phase: 'ended' }) })).toBe(false);
    expect(isFollowing({ tracking: null })).toBe(false);
    expect(isFollowing(null)).toBe(false);
  });
});

describe('how well a target can be known', () => {
  test('is a word for every inverse condition number', () => {
    const words = [0.7, 0.2, 0.05, 0.001, 0].map((value) => observability(value).text);
    expect(words).toEqual(['well', 'fairly', 'poorly', 'hardly', 'hardly']);
    expect(observability(null).text).toBe('not known');
    expect(observability(NaN).text).toBe('not known');
  });

  test('is said of the moment alone, without a cause that it does not tell', () => {
    for (const value of [0.7, 0.2, 0.05, 0.001, 0]) {
      const { meaning } = observability(value);
      expect(meaning).toMatch(/^At this moment .*left/);
      expect(meaning).not.toMatch(/far|straight/);
    }
    const turning = report(0, { inverse_condition: 0.05, determinant_m2_s: 0.21 });
    expect(knowable(turning, 0.2).text).toBe('enough');
    expect(observability(0.05).meaning).toContain('must keep turning');
  });

  test('is no cause for worry from afar while the barrier holds', () => {
    const far = report(0, { inverse_condition: 0.0005, determinant_m2_s: 0.21 });
    expect(knowable(far, 0.2)).toEqual({ text: 'slowly', tone: 'plain' });
    expect(knowableFigure(far, 0.2)).toMatch(/^\|D\| \d+ % of its level$/);
    expect(knowableFigure(far, null)).toContain('inverse condition');
    expect(knowable(report(0, { determinant_m2_s: -0.21 }), 0.2)).toEqual({
      text: 'well',
      tone: 'ok',
    });
    expect(knowable(report(0, { determinant_m2_s: 0.02 }), 0.2)).toEqual({
      text: 'just enough',
      tone: 'plain',
    });
  });

  test('is too little only once the ellipse grows', () => {
    const sized = (second: number, variance: number) => {
      const [only] = report(second).hypotheses;
      const hypotheses = only ? [{ ...only, covariance_m2: [variance, 0, variance] as const }] : [];
      return report(second, { hypotheses, determinant_m2_s: second % 2 ? 0.3 : -0.1 });
    };
    const seconds = Array.from({ length: 61 }, (_, i) => i * 3);
    const steady = lately(seconds.map((s) => sized(s, 0.01 + 0.004 * (s % 2))));
    const grown = lately(seconds.map((s) => sized(s, s < 120 ? 0.01 : 0.04)));
    expect(steady.grows).toBe(false);
    expect(steady.determinant).toBeCloseTo(0.2, 2);
    expect(grown.grows).toBe(true);
    expect(lately([report(0)])).toEqual({ determinant: 0.1, grows: false });
    expect(lately([])).toEqual({ determinant: null, grows: false });
    expect(knowable(report(0), 0.4, grown)).toEqual({ text: 'too little', tone: 'watch' });
  });

  test('is judged over the last minute, not by how the tail stands', () => {
    const past = { determinant: 0.21, grows: false };
    expect(knowable(report(0, { determinant_m2_s: 0.02 }), 0.2, past).text).toBe('well');
    expect(knowableFigure(report(0), 0.2, past)).toMatch(/^last minute: \|D\| 105 %/);
  });

  test('is nothing to speak of while no range is believed', () => {
    expect(knowable(report(0, { phase: 'lost' }), 0.2)).toMatchObject({ text: 'not now' });
    expect(knowableFigure(report(0, { phase: 'coasting' }), 0.2)).toBe('no range is believed');
    expect(knowable(report(0, { phase: 'ended' }), 0.2).text).toBe('not known');
  });

  test('is not known before the first range', () => {
    expect(knowable(report(0, { hypotheses: [] }), 0.2).text).toBe('not known');
  });

  test('says what the barrier does', () => {
    expect(barrierSentence(report(0)).text).toContain('bends the course');
    expect(barrierSentence(report(0, { command: [1, 0] })).text).toContain('changes nothing');
    expect(barrierSentence(report(0, { phase: 'lost' })).text).toContain('waits');
    expect(barrierSentence(report(0, { is_feasible: false })).text).toContain('cannot be kept');
    expect(barrierSentence(report(0, { is_barrier_on: false })).text).toContain('teaching');
  });
});

describe('the orders to ping and to be silent', () => {
  const said = { isSilenced: false, isOld: false, isOver: false, order: undefined };
  const order = (level: 'queued' | 'applied', kind: 'ping' | 'quiet' | 'surface' = 'quiet') => ({
    kind,
    refusal: null,
    command: { id: 'command-1', robot: 'mini-1', kind, level, levels: [], created_at: '', expires_at: '', text: '' },
  }); // prettier-ignore

  test('are offered only where they change something', () => {
    expect(pingOrders(said)).toEqual({ ping: false, quiet: true });
    expect(pingOrders({ ...said, isSilenced: true })).toEqual({ ping: true, quiet: false });
    expect(pingOrders({ ...said, isOver: true })).toEqual({ ping: false, quiet: false });
    expect(pingOrders({ ...said, isOver: true, isSilenced: true })).toEqual({
      ping: true,
      quiet: false,
    });
  });

  test('are both offered where it is not known whether the robot pings', () => {
    const both = { ping: true, quiet: true };
    expect(pingOrders({ ...said, isOld: true })).toEqual(both);
    expect(pingOrders({ ...said, isSilenced: true, isOld: true })).toEqual(both);
    expect(pingOrders({ ...said, order: order('queued') })).toEqual(both);
    expect(pingOrders({ ...said, order: { ...order('queued'), command: null } })).toEqual(both);
    expect(pingOrders({ ...said, order: order('applied') }).ping).toBe(false);
    expect(pingOrders({ ...said, order: order('queued', 'surface') }).ping).toBe(false);
    const refused = { kind: 'quiet' as const, command: null, refusal: 'It has no modem.' };
    expect(pingOrders({ ...said, order: refused }).ping).toBe(false);
  });
});

describe('settings of the following', () => {
  test('that nothing keeps observable are for teaching', () => {
    expect(isTeaching(CONFIG)).toBe(false);
    expect(isTeaching(changed('barrier', { controller: 'nominal' }))).toBe(true);
    expect(isTeaching(changed('barrier', { controller: 'mpc_none' }))).toBe(false);
    expect(isTeaching(null)).toBe(false);
  });

  test('name what keeps the target observable, as the station does', () => {
    const keepers = ['barrier', 'nominal', 'mpc_none', 'mpc_trace'].map((controller) =>
      keeperOf(changed('barrier', { controller })),
    );
    expect(keepers).toEqual(['barrier', 'teaching', 'comparison', 'predictive']);
    expect(barrierSentence(report(0), 'comparison').tone).toBe('watch');
    expect(barrierSentence(report(0), 'predictive').text).toContain('predictive controller');
  });

  test('tell the level of the determinant and the radius of the orbit', () => {
    expect(determinantLevel(CONFIG)).toBeCloseTo(0.2, 12);
    expect(orbitRadius(CONFIG)).toBeCloseTo(0.5046, 4);
    const off = changed('barrier', { controller: 'nominal' });
    expect(determinantLevel(off)).toBeNull();
    expect(orbitRadius(off)).toBeNull();
  });

  test('show only what means something for the chosen target', () => {
    const tag = changed('target', { kind: 'tag' });
    expect(isNeeded(['target', 'address'], CONFIG)).toBe(false);
    expect(isNeeded(['target', 'address'], tag)).toBe(true);
    expect(isNeeded(['target', 'speed_m_s'], tag)).toBe(false);
    expect(isNeeded(['target', 'width_m'], CONFIG)).toBe(true);
    expect(isNeeded(['target', 'period_s'], CONFIG)).toBe(false);
    expect(isNeeded(['target', 'speed_m_s'], changed('target', { path: 'static' }))).toBe(false);
    const nominal = changed('barrier', { controller: 'nominal' });
    expect(isNeeded(['barrier', 'slope'], nominal)).toBe(false);
    expect(isNeeded(['barrier', 'heading_gain_per_s'], nominal)).toBe(true);
    const predictive = changed('barrier', { controller: 'mpc_trace' });
    expect(isNeeded(['barrier', 'heading_gain_per_s'], predictive)).toBe(false);
    expect(isNeeded(['motion', 'duration_s'], predictive)).toBe(true);
  });

  test('say where the target is thought to be at first, with 95 %', () => {
    expect(guessOf(CONFIG)).toEqual({ at: [1.4, 0.7], radiusM: 0.35 * 2.4477 });
    expect(guessOf(null)).toBeNull();
  });

  test('name the target with its address where it has one', () => {
    expect(targetName(CONFIG)).toBe('a virtual target');
    expect(targetName(changed('target', { kind: 'tag' }))).toBe('an acoustic tag (address 10)');
  });
});

describe('reports over time', () => {
  test('come once each and in the order of their measuring', () => {
    const [a, b, c] = [report(0), report(1), report(2)];
    expect(merged([a, b], [a, b, c])).toEqual([a, b, c]);
    expect(merged([], [b, a, c])).toEqual([b, c]);
    expect(merged([a, b, c], [b])).toEqual([a, b, c]);
  });

  test('draw a gap where nothing was heard from the robot', () => {
    const columns = trackColumns([0, 1, 2, 3, 60, 61].map((second) => report(second)));
    expect(columns.t.map((t) => t - START / 1000)).toEqual([0, 1, 2, 3, 59, 60, 61]);
    expect(columns.doneTurn[4]).toBeNull();
    expect(columns.doneTurn[5]).toBeCloseTo((0.5 * 180) / Math.PI);
  });

  test('draw a range only where it is fresh, and never an error without a truth', () => {
    const columns = trackColumns([
      report(0),
      report(1, { range_age_s: 30, phase: 'lost' }),
      report(2, { range_m: null, hypotheses: [] }),
    ]);
    expect(columns.range).toEqual([5, null, null]);
    expect(columns.distance).toEqual([5, 5, null]);
    expect(columns.inverseCondition).toEqual([0.5, 0.5, null]);
    expect(columns.error).toEqual([null, null, null]);
  });

  test('tell how far the likeliest estimate is away', () => {
    expect(distanceOf(report(0))).toBe(5);
    expect(distanceOf(report(0, { hypotheses: [] }))).toBeNull();
  });

  test('put the ring of a range where it was heard', () => {
    const reports = [0, 1, 2, 3, 4].map((second) => report(second));
    const shown = report(4, { range_age_s: 2.9 });
    expect(rangeOrigin(reports, shown)).toEqual([1, 0]);
    expect(rangeOrigin([], shown)).toEqual([4, 0]);
  });
});

describe('the account of a plan to follow a target', () => {
  const text = (config: JsonObject, title: string) =>
    trackFacts(config).find((fact) => fact.title === title)?.text;

  test('says what it follows, for how long and what keeps it observable', () => {
    const whole = changed('motion', { duration_s: 600, depth_m: 0 });
    expect(text(whole, 'Follows')).toBe(
      'a virtual target on a circle of 0.3\u00a0m radius, 0.01\u00a0m/s',
    );
    expect(text(changed('target', { kind: 'tag' }), 'Follows')).toContain('address 10');
    expect(text(whole, 'At most for')).toBe('10 min 00 s');
    expect(text(whole, 'Swims')).toBe('at the surface');
    expect(text(whole, 'Lost')).toContain('after 15 s of silence, given up 2 min 00 s later');
    expect(text(whole, 'Keeps it observable')).toContain('orbit of about 0.5\u00a0m');
    const off = changed('barrier', { controller: 'nominal' });
    expect(text(off, 'Keeps it observable')).toBe('nothing (teaching)');
  });

  test('says whether the battery lasts, and never more than is known', () => {
    const battery = { used: 0.05, left: 0.8, reserve: 0.1, lasts_s: 8400 };
    expect(batteryText(battery)).toBe(
      'takes about 5\u00a0% of 80\u00a0% left, and keeps 10\u00a0%: lasts 2 h 20 min',
    );
    expect(batteryText({ ...battery, left: null })).toContain('not known');
  });
});
