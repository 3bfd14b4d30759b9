import { expect, test } from 'vitest';
import { search, termsOf, type Section } from './search';

function section(title: string, text: string, chapter = 'A chapter'): Section {
  return { address: `/help/${title}`, chapter, title, text };
}

const SECTIONS = [
  section('Surface now', 'Hold the red button. The robot comes up.'),
  section('The robot is overdue', 'It was not heard. Read when it should surface by itself.'),
  section('Budgets', 'Energy, time and satellite bytes.'),
];

function titles(query: string): string[] {
  return search(SECTIONS, query).map(({ section: { title } }) => title);
}

test('a word in a title counts for more than the same word in a text', () => {
  expect(titles('surface')).toEqual(['Surface now', 'The robot is overdue']);
});

test('a beginning of a word finds it, and so does another form of it', () => {
  expect(titles('sat')).toEqual(['Budgets']);
  expect(titles('surfacing')).toEqual(['Surface now', 'The robot is overdue']);
});

test('a section with more of the words comes first', () => {
  expect(titles('button surface robot')[0]).toBe('Surface now');
});

test('a question is read without its empty words', () => {
  expect(termsOf('Why is my robot not heard?')).toEqual(['robot', 'heard']);
  expect(titles('why is my robot not heard')[0]).toBe('The robot is overdue');
});

test('what is nowhere finds nothing, and so does no word', () => {
  expect(titles('zeppelin')).toEqual([]);
  expect(titles('  ?! ')).toEqual([]);
});

test('the words that were found are marked in the piece of text that is shown', () => {
  const far = `${'far '.repeat(60)}satellite link ${'away '.repeat(60)}`;
  const [hit] = search([section('Far', far)], 'satellite');
  const marked = hit?.pieces.filter(({ isFound }) => isFound).map(({ text }) => text);
  expect(marked).toEqual(['satellite']);
  expect(hit?.pieces[0]?.text).toBe('… ');
  expect(hit?.pieces.at(-1)?.text).toBe(' …');
  expect((hit?.pieces ?? []).map(({ text }) => text).join('').length).toBeLessThan(200);
});

test('at most twenty sections are found', () => {
  const many = Array.from({ length: 50 }, (_, index) => section(`Robot ${index}`, 'text'));
  expect(search(many, 'robot')).toHaveLength(20);
});
