"""A satellite service for tests: fast, of a fixed date, with one modem."""

import random
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path

from robot_link.clock import ScaledClock
from simulator.iridium.network import IridiumNetwork, SatelliteConditions
from simulator.iridium.session import MobileOriginatedMessage
from simulator.iridium.subscriber import Account, Carrier
from tests.robot_link.rig import until

IMEI = "300234010753370"
STARTED_AT = datetime(2026, 3, 14, 12, 0, 0, tzinfo=UTC)
QUICK = SatelliteConditions(latency_s=1.0, jitter_s=1.0, session_s=5.0)


class HandClock:
    """A clock that is set by hand; what waits for it does not wait long."""

    speed = 5000.0

    def __init__(self) -> None:
        self.time = STARTED_AT

    def now(self) -> datetime:
        return self.time

    def advance(self, **duration: float) -> None:
        self.time += timedelta(**duration)


def running_clock(speed: float = 500.0) -> ScaledClock:
    return ScaledClock(datetime.now(UTC), STARTED_AT, speed)


async def rung(network: IridiumNetwork) -> None:
    """Wait until a message that was just accepted has rung, twice as it does, and is done."""
    rings: list[None] = []
    stop = network.on_ring(IMEI, lambda: rings.append(None))
    await until(lambda: len(rings) >= 2)
    stop()


def network_of(
    conditions: SatelliteConditions = QUICK,
    *,
    seed: int = 1,
    clock: HandClock | ScaledClock | None = None,
    carrier: Carrier = "rockblock",
    in_view: Callable[[str], bool] = lambda _imei: True,
    memory_file: Path | None = None,
    listens: bool = True,
) -> tuple[IridiumNetwork, list[MobileOriginatedMessage]]:
    """Return a network with one modem, and the list of what its gateway is told."""
    chosen = clock or running_clock()
    network = IridiumNetwork(random.Random(seed), conditions, chosen, in_view, memory_file)
    network.add_subscriber(IMEI, Account("fleet", "word"), carrier=carrier, thing="thing-1")
    told: list[MobileOriginatedMessage] = []
    if listens:
        network.on_message(carrier, told.append)
    return network, told
