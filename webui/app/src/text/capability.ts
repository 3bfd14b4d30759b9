import type { Robot } from '../api/types';

type Key = Robot['capabilities'][number]['key'];

/** Why a robot cannot do something, in a sentence; empty where it can. */
export function reasonAgainst(robot: Robot, key: Key): string {
  return robot.capabilities.find((one) => one.key === key)?.reason ?? '';
}
