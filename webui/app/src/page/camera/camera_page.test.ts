import { describe, expect, it } from 'vitest';
import type { Camera } from '../../api/types';
import { idList, latencyWord, remarks, setUpWord, standWord, withinWord } from './camera_word';
import { emptyCells, outline } from './coverage';
import { idsOf, shownTag, zeroOf } from './latency';
import { setUpSteps } from './set_up';
import { freeName } from './source';

const camera = (changes: Partial<Camera>) =>
  ({ state: 'running', words: '', advice: '', moved: '', missing: '', ...changes }) as Camera;

describe('words about a camera', () => {
  it('ids that follow each other are a range', () => {
    expect(idList([104, 100, 101, 102, 110, 111])).toBe('100 to 102, 104, 110, 111');
    expect(idList([])).toBe('none');
  });

  it('what is wrong comes first and nothing twice', () => {
    const told = { words: 'No route to it.', missing: 'Show it the board.', advice: '' };
    expect(remarks(camera({ state: 'silent', ...told }))).toEqual([
      'No route to it.',
      'Show it the board.',
    ]);
    expect(remarks(camera({}))).toEqual([]);
  });

  it('a state without words says what to do', () => {
    expect(remarks(camera({ state: 'silent' }))[0]).toContain('cable');
  });

  it('a camera that is set up may still be left out', () => {
    expect(setUpWord({ step: 'lens', is_used: false })).toBe('Uncalibrated');
    expect(setUpWord({ step: 'done', is_used: false })).toBe('Left out');
    expect(setUpWord({ step: 'done', is_used: true })).toBe('Used');
  });

  it('a place that nobody knows has no shift', () => {
    expect(standWord({ stand: 'unknown', shift_px: 0 }).text).toBe('not known');
    expect(standWord({ stand: 'moved', shift_px: 1.31 }).text).toBe('moved, 1.3 px');
  });

  it('a latency that nobody measured is not told as a number', () => {
    expect(latencyWord({ latency_s: null, latency_std_s: null })).toContain('not measured');
    expect(latencyWord({ latency_s: 0.048, latency_std_s: 0.006 })).toBe('48 ± 6 ms');
  });

  it('never claims nothing at all', () => {
    expect(withinWord(0.0002)).toBe('within 1 mm');
    expect(withinWord(0.0031)).toBe('within 3 mm');
  });

  it('a new camera has the first free name', () => {
    expect(freeName(['tank-1', 'tank-3'])).toBe('tank-2');
  });
});

describe('the steps of the set-up', () => {
  it('are done one after another, the check last', () => {
    const steps = setUpSteps({ step: 'pose', lens: null });
    expect(steps.map(({ at, isPending }) => [at !== null, isPending])).toEqual([
      [true, false],
      [true, false],
      [false, true],
      [false, false],
    ]);
  });

  it('end with what was measured on the spot', () => {
    expect(setUpSteps({ step: 'done', lens: null }, true).every(({ at }) => at !== null)).toBe(
      true,
    );
  });
});

describe('coverage by the board', () => {
  it('has an outline without what lies inside', () => {
    const square = [
      [0, 0],
      [2, 0],
      [2, 2],
      [0, 2],
      [1, 1],
    ] as const;
    expect(outline(square)).toHaveLength(4);
    expect(outline(square)).not.toContainEqual([1, 1]);
  });

  it('counts the parts that it lacks', () => {
    expect(
      emptyCells([
        [0, 3],
        [0, 1],
      ]),
    ).toBe(2);
  });
});

describe('the page for the latency', () => {
  const check = {
    job: 'job-1',
    begun_at: '2026-11-22T15:04:05.000Z',
    now: '2026-11-22T15:04:04.000Z',
    step_s: 0.1,
    first_id: 200,
    count: 16,
  };
  const begun = Date.parse(check.begun_at);

  it('shows each tag for its step, again and again', () => {
    expect(shownTag(check, begun - 1)).toBeNull();
    expect(shownTag(check, begun)).toBe(200);
    expect(shownTag(check, begun + 1599)).toBe(215);
    expect(shownTag(check, begun + 1600)).toBe(200);
    expect(idsOf(check).at(-1)).toBe(215);
  });

  it('reads the clock in the middle between question and answer', () => {
    expect(zeroOf(check.now, 100, 140) + 120).toBe(Date.parse(check.now));
  });
});
