/** A part of the manual under one heading. */
export interface Section {
  address: string;
  chapter: string;
  title: string;
  text: string;
}

export interface Hit {
  section: Section;
  /** A piece of the text, cut where words that were looked for begin and end. */
  pieces: { text: string; isFound: boolean }[];
}

const MOST_HITS = 20;
const BEFORE = 60;
const LENGTH = 180;
/** What a word is worth by where it stands. */
const WORTH = { title: 6, chapter: 3, text: 1 };
/** Words that say nothing of what is looked for. */
const EMPTY = new Set(
  'a an and are at be by can do does for from has have how i if in is it my no not of on or the there to what when where which who why with'.split(
    ' ',
  ),
);

export function wordsOf(text: string): string[] {
  return text.toLowerCase().match(/[\p{L}\p{N}]+/gu) ?? [];
}

/** What is looked for; a query of nothing but empty words is taken as it is. */
export function termsOf(query: string): string[] {
  const all = wordsOf(query);
  const telling = all.filter((word) => !EMPTY.has(word));
  return [...new Set(telling.length > 0 ? telling : all)];
}

/**
 * Sections that hold the words of a query, the best first: those with most of the words, then those
 * with them in their titles. A word finds all that begin with it, and, from four letters on, its
 * own stem ("surfacing" finds "surface").
 */
export function search(sections: readonly Section[], query: string): Hit[] {
  const terms = termsOf(query);
  if (terms.length === 0) return [];
  return sections
    .map((section) => ({ section, ...scored(section, terms) }))
    .filter(({ met }) => met > 0)
    .sort((a, b) => b.met - a.met || b.score - a.score)
    .slice(0, MOST_HITS)
    .map(({ section }) => ({ section, pieces: excerpt(section.text, terms) }));
}

function scored(section: Section, terms: readonly string[]): { met: number; score: number } {
  const parts = { title: section.title, chapter: section.chapter, text: section.text };
  const words = Object.entries(parts).map(
    ([part, text]) => [WORTH[part as keyof typeof WORTH], wordsOf(text)] as const,
  );
  let [met, score] = [0, 0];
  for (const term of terms) {
    const worths = words.filter(([, all]) => all.some((word) => matches(word, term)));
    if (worths.length === 0) continue;
    met += 1;
    score += worths.reduce((sum, [worth]) => sum + worth, 0);
  }
  return { met, score };
}

function matches(word: string, term: string): boolean {
  return word.startsWith(term) || (term.length >= 4 && word.startsWith(stem(term)));
}

/** A word without the ending of its form; never shorter than four letters. */
function stem(word: string): string {
  const cut = word.replace(/(ing|ed|es|s|e)$/, '');
  return cut.length >= 4 ? cut : word;
}

function excerpt(text: string, terms: readonly string[]): Hit['pieces'] {
  const pieces: Hit['pieces'] = [];
  const tokens = [...text.matchAll(/[\p{L}\p{N}]+/gu)];
  const isHit = (word: string) => terms.some((term) => matches(word.toLowerCase(), term));
  const first = tokens.find(([word]) => isHit(word))?.index ?? 0;
  const begin = first <= BEFORE ? 0 : text.indexOf(' ', first - BEFORE) + 1;
  const end = Math.min(text.length, begin + LENGTH);
  const add = (from: number, to: number, isFound: boolean) => {
    if (to > from) pieces.push({ text: text.slice(from, to), isFound });
  };
  let at = begin;
  if (begin > 0) pieces.push({ text: '… ', isFound: false });
  for (const token of tokens) {
    const [word] = token;
    if (token.index < begin || token.index + word.length > end || !isHit(word)) continue;
    add(at, token.index, false);
    add(token.index, token.index + word.length, true);
    at = token.index + word.length;
  }
  add(at, end, false);
  if (end < text.length) pieces.push({ text: ' …', isFound: false });
  return pieces;
}
