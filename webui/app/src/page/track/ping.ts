import { isSettled, type Order } from '../../live/order.svelte';

/** What is known of a robot's pinging. */
interface Pinging {
  /** By what it said last it was told not to ping. */
  isSilenced: boolean;
  /** What it said last is older than its limit. */
  isOld: boolean;
  /** Its mission is over. */
  isOver: boolean;
  /** The latest order to it from here. */
  order: Pick<Order, 'kind' | 'command' | 'refusal'> | undefined;
}

/**
 * Which orders change something; both where it is not known whether the robot pings.
 *
 * While an order is on its way the robot may have taken it already or may never take it.
 */
export function pingOrders({ isSilenced, isOld, isOver, order }: Pinging): {
  ping: boolean;
  quiet: boolean;
} {
  const isUnknown = isOld || isUnderWay(order);
  return {
    ping: isSilenced || (isUnknown && !isOver),
    quiet: !isOver && (!isSilenced || isUnknown),
  };
}

function isUnderWay(order: Pinging['order']): boolean {
  if (order?.kind !== 'ping' && order?.kind !== 'quiet') return false;
  return order.refusal === null && !(order.command && isSettled(order.command));
}
