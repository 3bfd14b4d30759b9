import { describe, expect, test } from 'vitest';
import type { IdentifiedParameter } from '../../api/types';
import { costColumns, fitPlots } from './fit';
import {
  changeText,
  intervalText,
  isOffset,
  leftOutText,
  offsetText,
  searchText,
  verdictSummary,
  verdictText,
} from './verdict';

function parameter(change: Partial<IdentifiedParameter>): IdentifiedParameter {
  return {
    name: 'drag_0',
    title: 'Drag',
    unit: '',
    before: 2,
    after: 2.5,
    low: 2.4,
    high: 2.6,
    std: 0.05,
    verdict: 'identified',
    reason: '',
    ...change,
  };
}

describe('a verdict', () => {
  test('parts the figure from the reason', () => {
    expect(verdictText(parameter({}))).toEqual({
      text: 'identified', tone: 'ok', figure: '', reason: '',
    }); // prettier-ignore
    expect(verdictText(parameter({ reason: '+-3.1 %' }))).toMatchObject({
      figure: '±3.1 %',
      reason: '',
    });
    const reason = '+-38 %; only the product of lift and drag enters';
    expect(verdictText(parameter({ verdict: 'weak', reason }))).toEqual({
      text: 'weak', tone: 'watch', figure: '±38 %', reason: 'Only the product of lift and drag enters.',
    }); // prettier-ignore
    const unbound = { verdict: 'not identifiable', reason: 'Only the product enters.' } as const;
    expect(verdictText(parameter(unbound))).toMatchObject({
      figure: '',
      reason: 'Only the product enters.',
    });
  });

  test('of an actuator’s offset is told in the units of the trim', () => {
    const offset = { name: 'net_buoyancy_offset_kg', unit: 'kg', after: 0.0012, std: 0.0003 };
    expect(isOffset(parameter(offset))).toBe(true);
    expect(isOffset(parameter({}))).toBe(false);
    expect(offsetText(parameter(offset))).toBe('Net buoyancy +1.20 ± 0.30 g');
    const unsure = { name: 'mass_position_offset_m', unit: 'm', after: -0.001, std: null };
    expect(offsetText(parameter(unsure))).toBe('Mass position −1.00 mm, not identifiable');
  });

  test('of a search that goes on says how far it got', () => {
    const curve = [{ iteration: 12, cost: 0.5 }];
    expect(searchText('the swarm moves', curve)).toBe('the swarm moves, move 12, best cost 0.500');
    const told = 'move 12 of 60, best cost 0.5';
    expect(searchText(told, curve)).toBe(told);
    expect(searchText('waiting', [])).toBe('waiting');
  });

  test('says what changed and in which bounds', () => {
    expect(changeText(parameter({}))).toBe('+25 %');
    expect(changeText(parameter({ after: 1.9 }))).toBe('−5.0 %');
    expect(changeText(parameter({ after: 2.0000001 }))).toBe('');
    expect(changeText(parameter({ before: 0 }))).toBe('');
    expect(changeText(parameter({ before: -12.1, after: -8.98 }))).toBe('−26 %');
    expect(intervalText(parameter({}))).toBe('2.40 to 2.60');
    expect(intervalText(parameter({ low: null }))).toBe('unbounded');
  });

  test('is counted in one sentence', () => {
    const verdicts = ['identified', 'identified', 'weak', 'fixed'] as const;
    expect(verdictSummary(verdicts.map((verdict) => parameter({ verdict })))).toBe(
      '2 identified, 1 weak.',
    );
    expect(verdictSummary([parameter({ verdict: 'fixed' })])).toBe('No parameter was searched.');
  });

  test('of a stretch left out says when, how long and why', () => {
    const gap = { kind: 'gap', start_s: 61, end_s: 73, message: 'no sample arrived.' };
    expect(leftOutText(gap, '2026-11-21T10:00:00Z')).toBe('10:01:01Z for 12 s: no sample arrived.');
  });
});

describe('a fit', () => {
  test('puts measured beside predicted in the units of the screen, holes kept', () => {
    const [plot] = fitPlots({
      time_s: [0, 1],
      measured: { pitch_rad: [Math.PI / 2, null] },
      before: { pitch_rad: [0, 0] },
      after: { pitch_rad: [Math.PI / 4, 0] },
    });
    expect(plot?.data).toEqual([
      [0, 1],
      [90, null],
      [0, 0],
      [45, 0],
    ]);
    expect(plot?.lines.map(({ label, dash }) => [label, dash !== undefined])).toEqual([
      ['measured', false],
      ['predicted before', true],
      ['predicted after', true],
    ]);
  });

  test('turns depth downwards only', () => {
    const values = { depth_m: [1], pitch_rad: [1] };
    const plots = fitPlots({ time_s: [0], measured: values, before: values, after: values });
    expect(plots.map(({ isDownwards }) => isDownwards)).toEqual([true, false]);
  });

  test('shows a part that was left out as a gap', () => {
    const depth_m = [1, 2, 3, 4];
    const fit = { measured: { depth_m }, before: { depth_m }, after: { depth_m } };
    const [plot] = fitPlots({ time_s: [0, 1, 2, 60], ...fit });
    expect(plot?.data[0]).toEqual([0, 1, 2, 31, 60]);
    expect(plot?.data[3]).toEqual([1, 2, 3, null, 4]);
  });

  test('has no place for a cost of 0 on a scale of tenfold steps', () => {
    const curve = [
      { iteration: 2, cost: 0 },
      { iteration: 1, cost: 4 },
    ];
    expect(costColumns(curve)).toEqual([
      [1, 2],
      [4, null],
    ]);
  });
});
