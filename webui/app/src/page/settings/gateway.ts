import type { Gateway, GatewayChange } from '../../api/types';

export interface TypedAccount {
  url: string;
  username: string;
  /** Empty: as it is. */
  password: string;
  /** Empty: as it is. */
  publicKey: string;
  confirms: boolean;
}

/** What of an account a gateway asks for. */
export interface AccountFields {
  username: boolean;
  /** Name of the secret; empty if there is none. */
  secret: string;
  publicKey: boolean;
  confirms: boolean;
}

const FIELDS: Record<string, AccountFields> = {
  rockblock: { username: true, secret: 'Password', publicKey: true, confirms: false },
  cloudloop: { username: false, secret: 'Token', publicKey: false, confirms: false },
  directip: { username: false, secret: '', publicKey: false, confirms: true },
};

export function fieldsOf(kind: string): AccountFields {
  return FIELDS[kind] ?? { username: true, secret: 'Password', publicKey: true, confirms: true };
}

/** What of an account was changed; a secret that is not typed stays as it is. */
export function changeOf(known: Gateway, typed: TypedAccount): GatewayChange {
  const [url, username] = [typed.url.trim(), typed.username.trim()];
  return {
    ...(url !== known.url && { url }),
    ...(username !== known.username && { username }),
    ...(typed.password !== '' && { password: typed.password }),
    ...(typed.publicKey.trim() !== '' && { public_key: `${typed.publicKey.trim()}\n` }),
    ...(typed.confirms !== known.confirms && { confirms: typed.confirms }),
  };
}

/** Whether messages can be handed to it: by a secret, or by a port where there is none. */
export function isSetUp({ kind, has_password, port }: Gateway): boolean {
  return fieldsOf(kind).secret === '' ? port !== null : has_password;
}

export function refusedCount({ refused }: Gateway): number {
  return Object.values(refused).reduce((sum, count) => sum + count, 0);
}

const REASONS: Record<string, string> = {
  bad_path: 'wrong address',
  too_often: 'too often',
  too_large: 'too large',
  no_key: 'no key to check it with',
  signature: 'bad signature',
  disagrees: 'not what was signed',
  malformed: 'not readable',
  held_back: 'plug was out',
  not_kept: 'could not be stored',
  address: 'wrong sender',
};

/** `bad signature 1, wrong address 2` */
export function refusedText({ refused }: Gateway): string {
  return Object.entries(refused)
    .filter(([, count]) => count > 0)
    .map(([reason, count]) => `${REASONS[reason] ?? reason.replaceAll('_', ' ')} ${count}`)
    .join(', ');
}
