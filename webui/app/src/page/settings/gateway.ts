import type { Gateway, GatewayChange } from '../../api/types';

export interface TypedAccount {
  url: string;
  username: string;
  /** Empty: as it is. */
  password: string;
  /** Empty: as it is. */
  publicKey: string;
}

/** What of an account was changed; a secret that is not typed stays as it is. */
export function changeOf(known: Gateway, typed: TypedAccount): GatewayChange {
  const [url, username] = [typed.url.trim(), typed.username.trim()];
  return {
    ...(url !== known.url && { url }),
    ...(username !== known.username && { username }),
    ...(typed.password !== '' && { password: typed.password }),
    ...(typed.publicKey.trim() !== '' && { public_key: `${typed.publicKey.trim()}\n` }),
  };
}

export function isSetUp({ url, username, has_password }: Gateway): boolean {
  return url !== '' && (username !== '' || has_password);
}

export function refusedCount({ refused }: Gateway): number {
  return Object.values(refused).reduce((sum, count) => sum + count, 0);
}
