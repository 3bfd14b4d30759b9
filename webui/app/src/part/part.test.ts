import { describe, expect, test, vi } from 'vitest';
import type { CatalogueChannel, Command, Plan, RobotLink } from '../api/types';
import type { RobotLive } from '../live/station.svelte';
import { alarmLevel, gaugeRow, gaugeRows, limitWords, reading } from './gauge';
import { Keyboard } from './keyboard';
import { commandSteps, isFinished, orderSteps, orderText } from './order_steps';
import { planSentence, planSteps } from './plan_steps';

const EMPTY = {
  draft_at: null,
  sent_at: null,
  waiting_at: null,
  on_board_at: null,
  running_at: null,
  ended_at: null,
};

function command(...levels: Command['levels'][number]['level'][]): Command {
  return {
    id: 'command-1',
    robot: 'mini-1',
    kind: 'surface',
    level: levels.at(-1) ?? 'created',
    levels: levels.map((level, i) => ({
      level,
      at: `2026-11-21T04:00:0${i}Z`,
      carrier: level === 'expired' ? '' : 'xbee',
      reason: level === 'refused' ? 'no plan' : '',
    })),
    created_at: '2026-11-21T04:00:00Z',
    expires_at: '2026-11-21T05:00:00Z',
    text: '',
  };
}

describe('an order', () => {
  test('shows only what is proved, and what it waits for', () => {
    const order = {
      robot: 'mini-1',
      kind: 'surface' as const,
      id: 'command-1',
      command: command('queued'),
      refusal: null,
    };
    expect(
      orderSteps(order).map(({ title, at, isPending }) => [title, at !== null, isPending ?? false]),
    ).toEqual([
      ['Queued', true, false],
      ['Delivered', false, true],
      ['Done', false, false],
    ]);
  });

  test('says who carries it, and no radio that does not reach the robot', () => {
    const taken = command('queued');
    const radio = { carrier: 'xbee', kind: 'radio', state: 'stale', is_plugged: true } as RobotLink;
    const proof = { ...taken.levels[0], carrier: 'xbee' } as Command['levels'][number];
    const byRadio = { ...taken, levels: [proof] };
    const detail = (told: Command, links: RobotLink[]) => commandSteps(told, links)[0]?.detail;
    expect(detail(byRadio, [{ ...radio, state: 'live' }])).toBe('by XBee');
    expect(detail(byRadio, [radio])).toBe('XBee does not reach it now');
    const both = { ...taken, levels: [proof, { ...proof, carrier: 'rockblock' }] };
    expect(detail(both, [radio])).toBe('by RockBLOCK');
  });

  test('that was refused never looks done', () => {
    const steps = commandSteps(command('queued', 'refused'));
    expect(steps.map(({ title }) => title)).toEqual(['Queued', 'Refused']);
    expect(steps.at(-1)).toMatchObject({ isFault: true, detail: 'no plan' });
  });

  test('to surface is over once the robot is up, and says so', () => {
    const obeyed = {
      ...command('queued', 'radio', 'applied'),
      text: 'mini-1 obeys: it is coming up.',
    };
    const report = (mode: string, heard_at: string) =>
      ({ mode, links: [{ heard_at }] }) as unknown as RobotLive['report'];
    const rising = report('aborting', '2026-11-21T04:00:09Z');
    expect([orderText(obeyed, rising), isFinished(obeyed, rising)]).toEqual([obeyed.text, false]);
    const before = report('idle', '2026-11-21T04:00:01Z');
    expect(isFinished(obeyed, before)).toBe(false);
    const up = report('idle', '2026-11-21T04:00:09Z');
    expect([orderText(obeyed, up), isFinished(obeyed, up)]).toEqual([
      'mini-1 is up, as ordered.',
      true,
    ]);
  });

  test('that was refused stays until somebody has put it away', () => {
    expect(isFinished(command('queued', 'refused'), undefined)).toBe(false);
    expect(isFinished({ ...command('queued', 'applied'), kind: 'hold' }, undefined)).toBe(true);
    expect(isFinished(command('expired'), undefined)).toBe(true);
  });

  test('that expired overrules everything else', () => {
    expect(commandSteps(command('queued', 'radio', 'expired')).at(-1)).toMatchObject({
      title: 'Expired',
      isFault: true,
    });
  });
});

test.each(['a later order took its place', 'dropped: the robot is told to surface'])(
  'an order that ended since %s has not expired',
  (reason) => {
    const told = command('queued', 'expired');
    const levels = told.levels.map((each) => ({ ...each, reason }));
    expect(commandSteps({ ...told, levels }).at(-1)).toMatchObject({
      title: 'Overtaken',
      detail: reason,
      isFault: false,
    });
  },
);

describe('a plan', () => {
  const plan = (state: Plan['state'], ladder: Partial<Plan['ladder']>) => ({
    state,
    ladder: { ...EMPTY, ...ladder },
    stage: null,
    progress: null,
    message: '',
  });

  test('that was sent is not on board', () => {
    const steps = planSteps(plan('sent', { draft_at: 'a', sent_at: 'b' }));
    expect(steps.map(({ at }) => at)).toEqual(['a', 'b', null, null]);
    expect(steps[2]?.isPending).toBe(true);
    expect(planSentence(plan('sent', {}))).toContain('has not confirmed');
  });

  test('that came back unconfirmed is not said to be at the station alone', () => {
    const returned = { ...plan('draft', {}), message: 'Not confirmed on board: it expired.' };
    expect(planSentence(returned)).toContain('may still reach the robot');
    expect(planSentence(returned)).not.toContain('Only the station');
    expect(planSentence(plan('draft', {}))).toContain('Only the station');
  });

  test('that its robot ended early is said to have ended once', () => {
    const message = 'mini-1 ended plan-6 early: the target was lost for 120 s';
    for (const kind of ['survey', 'track_target']) {
      expect(planSentence({ ...plan('failed', {}), kind, message })).toBe(message);
    }
    const other = { ...plan('failed', {}), message: 'mini-1 was switched off.' };
    expect(planSentence(other)).toContain('before its last leg. mini-1 was');
  });

  test('that waits on board has a rung for that, and no other has', () => {
    const proved = { draft_at: 'a', sent_at: 'b', waiting_at: 'c' };
    const steps = planSteps(plan('waiting', proved));
    expect(steps.map(({ title }) => title)).toEqual([
      'Draft',
      'Sent',
      'Waiting on board',
      'On board',
      'Running',
    ]);
    expect(planSteps(plan('sent', { draft_at: 'a', sent_at: 'b' }))).toHaveLength(4);
  });

  test('that failed shows how far it came', () => {
    const steps = planSteps(plan('failed', { draft_at: 'a', sent_at: 'b', ended_at: 'c' }));
    expect(steps.map(({ title }) => title)).toEqual(['Draft', 'Sent', 'Failed']);
    expect(steps.at(-1)?.isFault).toBe(true);
  });
});

function known(key: string, title: string, others: Partial<CatalogueChannel> = {}) {
  const channel = {
    key,
    title,
    help: '',
    kind: 'flight',
    display_unit: null,
    decimals: 2,
    alarms: [],
    switch_words: ['off', 'on'],
    ...others,
  } as unknown as CatalogueChannel;
  return [key, channel] as const;
}

const CATALOGUE = Object.fromEntries([
  known('depth_m', 'Depth'),
  known('position_std_m', 'Position uncertainty'),
  known('heading_rad', 'Heading', { display_unit: 'deg', decimals: 0 }),
  known('pitch_rad', 'Pitch', { display_unit: 'deg', decimals: 1 }),
  known('net_buoyancy_kg', 'Net buoyancy', { display_unit: 'g', decimals: 1 }),
  known('battery_fraction', 'Battery', { display_unit: '%', decimals: 0 }),
  known('salinity', 'Practical salinity', { kind: 'field', decimals: 3 }),
  known('leak', 'Leak', {
    kind: 'switch',
    switch_words: ['dry', 'LEAK'],
    alarms: [{ level: 'critical', low: null, high: 0.5 }],
  }),
  known('internal_temperature', 'Internal temperature', {
    kind: 'housekeeping',
    alarms: [
      { level: 'critical', low: null, high: 75 },
      { level: 'warning', low: -5, high: 60 },
    ],
  }),
]);

describe('a gauge', () => {
  test('of a switch is a word', () => {
    const leak = gaugeRow(CATALOGUE, 'leak');
    expect(reading(leak, 0, '1')).toEqual({ text: 'dry', unit: '' });
    expect(reading(leak, 1, '1')).toEqual({ text: 'LEAK', unit: '' });
    expect(alarmLevel(leak, 1)).toBe('critical');
    expect(alarmLevel(leak, 0)).toBeNull();
  });

  test('knows the gravest limit that is crossed, and says all', () => {
    const row = gaugeRow(CATALOGUE, 'internal_temperature');
    expect([-9, 20, 61, 76].map((value) => alarmLevel(row, value))).toEqual([
      'warning',
      null,
      'warning',
      'critical',
    ]);
    expect(limitWords(row, 'degC')).toBe(
      'critical above 75 °C, warning below -5 °C or above 60 °C',
    );
  });

  test('stands with others of its kind, with all its digits', () => {
    expect(gaugeRow(CATALOGUE, 'salinity').group).toBe('water');
    expect(gaugeRow(CATALOGUE, 'leak').group).toBe('housekeeping');
    expect(reading(gaugeRow(CATALOGUE, 'salinity'), 34.7, '1')).toEqual({
      text: '34.700',
      unit: '',
    });
  });

  test('shows angles in degrees and headings in three digits', () => {
    expect(reading(gaugeRow(CATALOGUE, 'pitch_rad'), 0.3, 'rad', 'deg')).toEqual({
      text: '17.2',
      unit: '°',
    });
    expect(reading(gaugeRow(CATALOGUE, 'heading_rad'), -0.02, 'rad')).toEqual({
      text: '359',
      unit: '°',
    });
    expect(reading(gaugeRow(CATALOGUE, 'heading_rad'), 2 * Math.PI - 0.001, 'rad')).toEqual({
      text: '000',
      unit: '°',
    });
  });

  test('shows small numbers in their own unit', () => {
    expect(reading(gaugeRow(CATALOGUE, 'net_buoyancy_kg'), -0.0241, 'kg')).toEqual({
      text: '−24.1',
      unit: 'g',
    });
    expect(reading(gaugeRow(CATALOGUE, 'battery_fraction'), 0.684, '', '%')).toEqual({
      text: '68',
      unit: '%',
    });
  });

  test('shows a well known position to the millimetre', () => {
    expect(reading(gaugeRow(CATALOGUE, 'position_std_m'), 0.0034, 'm').text).toBe('0.003');
    expect(reading(gaugeRow(CATALOGUE, 'position_std_m'), 0.34, 'm').text).toBe('0.34');
  });

  test('of an unknown channel is shown all the same', () => {
    const channel = {
      value: 1,
      unit: '',
      display_unit: null,
      measured_at: '',
      received_at: '',
      age_s: 0,
      limit_s: 5,
      is_derived: false,
      impossible: 0,
    };
    const rows = gaugeRows(CATALOGUE, { turbidity: channel, depth_m: channel });
    expect(rows.map(({ title }) => title)).toEqual(['Depth', 'Turbidity']);
  });
});

describe('the keyboard', () => {
  function keyboard() {
    const actions = { go: vi.fn(), choose: vi.fn(), help: vi.fn(), replay: vi.fn(() => false) };
    return { keys: new Keyboard(actions), actions };
  }

  test('goes to pages by two keys', () => {
    const { keys, actions } = keyboard();
    keys.press('g');
    keys.press('p');
    expect(actions.go).toHaveBeenCalledWith('plan');
    keys.press('p');
    expect(actions.go).toHaveBeenCalledTimes(1);
  });

  test('walks through the robots and shows help', () => {
    const { keys, actions } = keyboard();
    keys.press(']');
    keys.press('[');
    keys.press('?');
    expect(actions.choose.mock.calls).toEqual([[1], [-1]]);
    expect(actions.help).toHaveBeenCalledOnce();
    expect(keys.press('x')).toBe(false);
  });
});
