"""Handing one datagram to a radio until it is confirmed, a few times."""

import asyncio
from collections.abc import Callable

from robot_link.transport.datagram import (
    Address,
    DatagramTransport,
    Delivery,
    Fate,
    PortClosedError,
)


async def deliver(
    transport: DatagramTransport,
    address: Address,
    data: bytes,
    *,
    attempts: int = 1,
    on_taken: Callable[[], None] = lambda: None,
    is_wanted: Callable[[], bool] = lambda: True,
    pause_s: Callable[[], float] = lambda: 0.0,
) -> Delivery:
    """Send a datagram, again where the far radio does not confirm.

    The far side may receive it more than once, so it must mean the same every time.

    Args:
        transport: The radio.
        address: Whom to send to.
        data: The datagram.
        attempts: How often at most.
        on_taken: Called each time that the radio has taken it.
        is_wanted: Asked before each attempt whether it shall still be sent.
        pause_s: Asked before each repetition how long to wait; unequal times keep two radios that
            talked at once from doing so again.

    Returns:
        The radio's last word; of unknown fate where there is no open port.
    """
    delivery = Delivery(Fate.UNKNOWN, detail="nothing was sent")
    for attempt in range(attempts):
        if attempt:
            await asyncio.sleep(pause_s())
        if not is_wanted():
            break
        try:
            fate = await transport.send(address, data)
        except PortClosedError as error:
            return Delivery(Fate.UNKNOWN, detail=str(error) or "the port is closed")
        on_taken()
        delivery = await fate
        if delivery.fate is not Fate.NOT_ACKNOWLEDGED:
            break
    return delivery
