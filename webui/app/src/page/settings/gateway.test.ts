import { expect, test } from 'vitest';
import type { Gateway } from '../../api/types';
import { changeOf, isSetUp, refusedCount, refusedText } from './gateway';

const GATEWAY: Gateway = {
  kind: 'rockblock', title: 'RockBLOCK', url: 'https://gateway/MT', username: 'anna', has_password: true,
  has_public_key: true, confirms: false, push_url: null, port: null, accepted: 1, duplicate: 0,
  refused: { signature: 1, too_large: 0, bad_path: 2 }, last_at: null, fault: null,
}; // prettier-ignore
const TYPED = {
  url: GATEWAY.url,
  username: 'anna',
  password: '',
  publicKey: '',
  confirms: false,
};

test('of an account only what was changed is sent, and a secret only when it is typed', () => {
  expect(changeOf(GATEWAY, TYPED)).toEqual({});
  expect(changeOf(GATEWAY, { ...TYPED, username: ' bob ', password: 'x y' })).toEqual({
    username: 'bob',
    password: 'x y',
  });
});

test('a gateway without a secret is set up when it listens', () => {
  const direct: Gateway = { ...GATEWAY, kind: 'directip', has_password: false };
  expect(isSetUp(direct)).toBe(false);
  expect(isSetUp({ ...direct, port: 10800 })).toBe(true);
  expect(isSetUp(GATEWAY)).toBe(true);
});

test('refused pushes are counted and told by reason', () => {
  expect(refusedCount(GATEWAY)).toBe(3);
  expect(refusedText(GATEWAY)).toBe('bad signature 1, wrong address 2');
});
