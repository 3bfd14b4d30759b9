"""A service's two ends in one process: a wire of real frames between them, as bad as is wanted."""

import asyncio
import random
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

from robot_link.mavlink.codec import (
    ROBOT_COMPONENT,
    STATION_COMPONENT,
    STATION_SYSTEM,
    Codec,
    WireMessage,
)
from robot_link.messages import SystemId
from robot_link.station.exchange import Patience

HASTY = Patience(answer_s=0.02, attempts=25)
ROBOT = SystemId(7)


@dataclass
class Wire:
    """Carries frames to a robot's service and its answers back to a client.

    ``hear`` of the robot returns its answers; loss and duplication hold for both ways.
    """

    robot: Callable[[WireMessage], Iterable[WireMessage]]
    loss: float = 0.0
    duplication: float = 0.0
    seed: int = 1
    system: SystemId = ROBOT
    is_cut: bool = False
    client: Callable[[WireMessage], None] = lambda _message: None
    asked: list[WireMessage] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._rng = random.Random(self.seed)
        self._station = Codec(STATION_SYSTEM, STATION_COMPONENT)
        self._robot = Codec(self.system, ROBOT_COMPONENT)

    async def deliver(self, messages: Iterable[WireMessage]) -> bool:
        await asyncio.sleep(0)
        for message in messages:
            for heard in self._carried(self._station.pack(message)):
                self.asked.append(heard)
                for answer in self.robot(heard):
                    for back in self._carried(self._robot.pack(answer)):
                        asyncio.get_running_loop().call_soon(self.client, back)
        return True

    def over_the_wire(self, message: WireMessage) -> WireMessage:
        """Return a robot's message as the station decodes it."""
        ((heard,), bad) = self._station.unpack(self._robot.pack(message))
        assert bad == 0
        return heard

    def _carried(self, frame: bytes) -> list[WireMessage]:
        if self.is_cut or self._rng.random() < self.loss:
            return []
        copies = 2 if self._rng.random() < self.duplication else 1
        return [self._station.unpack(frame).messages[0] for _ in range(copies)]
