import { describe, expect, it } from 'vitest';
import { darkModules, grouped, newKeyText } from './signing';

describe('signing of radios', () => {
  it('draws each run of dark modules once', () => {
    expect(darkModules(['0110', '1001'])).toBe('M1 0h2v1h-2zM0 1h1v1h-1zM3 1h1v1h-1z');
  });

  it('shows a key in groups that lose nothing', () => {
    const key = '0123456789abcdef'.repeat(4);
    expect(grouped(key)).toHaveLength(8);
    expect(grouped(key).join('')).toBe(key);
  });

  it('says what a new key ends before it is made', () => {
    expect(newKeyText('Ray', 'on')).toContain('present key ends at once');
    expect(newKeyText('Ray', 'undecided')).toContain('unsigned is refused');
  });
});
