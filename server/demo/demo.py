"""The station's end of the simulator's fault desk."""

import logging
from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime

import msgspec

from onboard.node.client import NodeClient
from onboard.node.wire import NodeAddress, NodeError, NodeFault, NodeGoneError, NodeSilentError
from server.base.problem import Problem, conflict, not_found

TOPIC = "faults"
_GONE = "The simulator does not answer; try again when it runs."

log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class SimulatedFault:
    """A fault that a robot can have."""

    title: str
    words: str
    since: datetime | None
    by: str
    needs_hands: bool


@dataclass(frozen=True, slots=True)
class _Kind:
    title: str
    words: str
    needs_hands: bool


@dataclass(frozen=True, slots=True)
class _Fault:
    kind: int
    since: datetime | None
    by: str


@dataclass(frozen=True, slots=True)
class _Told:
    kinds: list[_Kind]
    robots: dict[str, dict[str, _Fault]]

    def whole(self) -> dict[str, dict[str, SimulatedFault]]:
        """Return every fault with what its kind says."""
        return {
            robot: {name: self._whole(fault) for name, fault in faults.items()}
            for robot, faults in self.robots.items()
        }

    def _whole(self, fault: _Fault) -> SimulatedFault:
        kind = self.kinds[fault.kind]
        return SimulatedFault(kind.title, kind.words, fault.since, fault.by, kind.needs_hands)


class Demo:
    """Knows which faults the simulated robots have, and orders others. Belongs to one event loop.

    Args:
        port: Loopback port of the simulator's desk; None where there is no demo.
        changed: Told that the simulator said something new.
    """

    def __init__(self, port: int | None, changed: Callable[[], None]) -> None:
        self._client = None if port is None else NodeClient(NodeAddress(port=port))
        self._heard = None if self._client is None else self._client.subscribe(TOPIC)
        self._changed = changed
        self.robots: dict[str, dict[str, SimulatedFault]] = {}
        """By robot and by name, as the simulator said last."""

    @property
    def is_open(self) -> bool:
        """Whether there is a demo."""
        return self._client is not None

    async def connect(self) -> None:
        """Keep the connection to the simulator until cancelled."""
        if self._client is not None:
            await self._client.run()

    async def listen(self) -> None:
        """Take in what the simulator says until cancelled."""
        if self._heard is None:
            return
        async for value in self._heard:
            try:
                self.robots = msgspec.convert(value, _Told).whole()
            except (msgspec.ValidationError, IndexError) as error:
                log.warning("the simulator's faults cannot be read: %s", error)
            else:
                self._changed()

    async def cause(self, robot: str, fault: str, by: str) -> None:
        """Let a fault come now.

        Raises:
            Problem: 404 if there is no demo, robot or fault; 503 if the simulator does not answer.
        """
        await self._ask("cause", robot, fault, by)

    async def mend(self, robot: str, fault: str, by: str) -> None:
        """Undo a fault.

        Raises:
            Problem: As ``cause``; 409 if nobody can reach the robot.
        """
        await self._ask("mend", robot, fault, by)

    async def _ask(self, what: str, robot: str, fault: str, by: str) -> None:
        if self._client is None:
            raise not_found("This station runs no demo: no fault can be caused.")
        try:
            await self._client.ask(what, robot=robot, fault=fault, by=by)
        except NodeError as error:
            refusal = not_found if error.fault is NodeFault.UNKNOWN else conflict
            raise refusal(f"{error}.") from error
        except (NodeGoneError, NodeSilentError) as error:
            raise Problem(503, _GONE) from error
