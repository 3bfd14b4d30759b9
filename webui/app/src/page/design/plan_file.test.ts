import { describe, expect, it } from 'vitest';
import {
  asked,
  choicesOf,
  kindOf,
  nameOf,
  summaryOf,
  type PlanFile,
  type Question,
} from './plan_file';

const question = (key: string, unit = ''): Question => ({ key, unit, text: key, is_needed: true });
const file = (needs: readonly Question[]) => ({ needs }) as PlanFile;

describe('answers to what a plan file leaves open', () => {
  it('sends only what was answered', () => {
    expect(choicesOf({ turns_sign: true, imports_rest: false, area: undefined })).toBe(
      '{"turns_sign":true}',
    );
    expect(choicesOf({ default_depth_m: 0 })).toBe('{"default_depth_m":0}');
  });

  it('keeps a question that was answered, so that the answer can be taken back', () => {
    const before = [question('turns_sign'), question('land_surfaces')];
    const shown = asked(file([question('imports_rest')]), before, { turns_sign: true });
    expect(shown.map(({ key, is_needed }) => [key, is_needed])).toEqual([
      ['imports_rest', true],
      ['turns_sign', false],
    ]);
  });

  it('asks for metres, an area, or yes', () => {
    expect(kindOf(question('default_depth_m', 'm'))).toBe('number');
    expect(kindOf(question('area'))).toBe('area');
    expect(kindOf(question('imports_rest'))).toBe('yes');
  });
});

describe('a design of a file', () => {
  it('is called as the file, and otherwise where that is taken', () => {
    expect(nameOf('North bay.plan', [])).toBe('North bay');
    expect(nameOf('North bay.plan', ['North bay', 'North bay 2'])).toBe('North bay 3');
    expect(nameOf('.plan', [])).toBe('Imported');
  });

  it('is told in words', () => {
    const way = { kind: 'waypoints', waypoints: [{}, {}] };
    const of = (content: unknown) => ({ document: { content }, distance_m: 81.86 }) as PlanFile;
    expect(summaryOf(of(way))).toBe('2 waypoints over 81.9 m');
    expect(summaryOf(of({ kind: 'along_line' }))).toBe('along line');
  });
});
