"""Where faults are caused and undone while robots live, and told as they come.

A node (``onboard.node.server``) whose device is the whole simulation:

| question | values | answer |
|---|---|---|
| cause | robot, fault (one of its kinds), by (who asks; may be left out) | |
| mend | the same | |

Topic ``faults``: ``robots`` with the faults that each can have, by name: since (when it came, ISO
8601; null while it has not), by, and kind, the place in the list ``kinds`` of its title, its words
and needs_hands. It is published on each change. What is called a robot here may also be an
emulated camera, or the tank below it.

Topic ``news``: a fault that came or was undone: robot, text, is_over.

Robots may live in several processes, each with a desk; the desk of the first stands for those of
the others (``relay``).
"""

import asyncio
import logging
import math
from collections.abc import Awaitable, Callable, Mapping
from dataclasses import asdict, dataclass
from datetime import datetime
from typing import Any, Protocol

from onboard.node.client import NodeClient, Subscription
from onboard.node.server import NodeServer
from onboard.node.wire import Content, NodeError, NodeFault, NodeGoneError, NodeSilentError
from robot_link.clock import Clock
from robot_link.messages import RobotId
from simulator.fault import FaultKind

FAULTS, NEWS = "faults", "news"
_LOOK_S = 0.1
_BY_MAX = 80
_NEWS_WAITING = 64

_log = logging.getLogger(__name__)


class Faulty(Protocol):
    """A robot, a camera or a tank with which something may go wrong while it lives."""

    @property
    def fault_kinds(self) -> Mapping[str, FaultKind]:
        """What may be wrong with it, by name."""
        ...

    def begin_s(self, name: str) -> float:
        """Return when a fault comes, of its life; infinity if it does not."""
        ...

    @property
    def lived_s(self) -> float:
        """Seconds that it has lived."""
        ...

    @property
    def is_in_reach_of_hands(self) -> bool:
        """Whether it lies at the surface."""
        ...

    def cause(self, name: str) -> None:
        """Let a fault come now."""
        ...

    def mend(self, name: str) -> None:
        """Undo a fault."""
        ...


@dataclass(frozen=True, slots=True)
class FaultNews:
    """A fault that came, or that was undone."""

    robot: RobotId | None
    """Whose it is; None where it is no robot's."""
    text: str
    """One sentence."""
    is_over: bool = False


FaultTeller = Callable[[FaultNews], Awaitable[None]]


async def only_log(news: FaultNews) -> None:
    """Tell nobody but the log."""
    _log.warning("%s", news.text)


@dataclass(frozen=True, slots=True)
class _Caused:
    since: datetime
    by: str


class FaultDesk:
    """Causes and undoes faults of robots that live, and tells of each. Belongs to one event loop.

    Args:
        clock: The robots' time.
        tell: Told of each fault as it comes, and as it is undone.
        topics: What else is published at the desk, by others.
    """

    def __init__(
        self, clock: Clock, tell: FaultTeller = only_log, topics: tuple[str, ...] = ()
    ) -> None:
        self._clock = clock
        self._tell = tell
        self._faulty: dict[str, Faulty] = {}
        self._robots: set[str] = set()
        self._caused: dict[tuple[str, str], _Caused] = {}
        self._away: dict[NodeClient, Mapping[str, _Told]] = {}
        """What the desks of other processes said last."""
        asks = {"cause": self._cause, "mend": self._mend}
        self.server = NodeServer("faults", asks, (FAULTS, NEWS, *topics))

    def meet(self, robot: RobotId, faulty: Faulty) -> None:
        """Take a robot that lives from now on."""
        self._faulty[robot] = faulty
        self._robots.add(robot)
        self._publish()

    def meet_other(self, name: str, faulty: Faulty) -> None:
        """Take something that is no robot, such as a camera."""
        self._faulty[name] = faulty
        self._publish()

    async def run(self) -> None:
        """Tell of the faults that come by themselves, until cancelled."""
        while True:
            come = [
                (faulty.begin_s(name), robot, name)
                for robot, faulty in self._faulty.items()
                for name in faulty.fault_kinds
                if faulty.lived_s >= faulty.begin_s(name)
            ]
            for _, robot, name in sorted(come):
                if (robot, name) not in self._caused:
                    await self._came(robot, name, "")
            await asyncio.sleep(_LOOK_S)

    async def relay(self, other: NodeClient) -> None:
        """Stand for the desk of another process, until cancelled; somebody else runs the client."""
        faults, news = other.subscribe(FAULTS), other.subscribe(NEWS, _NEWS_WAITING)
        try:
            async with asyncio.TaskGroup() as group:
                group.create_task(self._relay_faults(other, faults), name="faults elsewhere")
                group.create_task(self._relay_news(news), name="news of faults elsewhere")
        finally:
            self._away.pop(other, None)
            self._publish()

    async def _relay_faults(self, other: NodeClient, faults: Subscription) -> None:
        async for value in faults:
            self._away[other] = _whole(value)
            self._publish()

    async def _relay_news(self, news: Subscription) -> None:
        async for value in news:
            await self._announce(FaultNews(**value))

    async def _announce(self, news: FaultNews) -> None:
        self.server.publish(NEWS, asdict(news))
        await self._tell(news)

    async def _asked_elsewhere(self, what: str, values: dict[str, Any]) -> bool:
        """Ask the process in which a robot lives, if it is another one; tell whether it is."""
        robot = str(values.get("robot"))
        desk = next((one for one, told in self._away.items() if robot in told), None)
        if desk is None:
            return False
        try:
            await desk.ask(what, **values)
        except (NodeGoneError, NodeSilentError) as error:
            raise NodeError(NodeFault.FAILED, f"{robot}: {error}") from error
        return True

    async def _cause(self, values: dict[str, Any]) -> Content:
        if await self._asked_elsewhere("cause", values):
            return {}
        robot, faulty, name, by = self._asked(values)
        if (robot, name) not in self._caused:
            faulty.cause(name)
            await self._came(robot, name, by)
        return {}

    async def _mend(self, values: dict[str, Any]) -> Content:
        if await self._asked_elsewhere("mend", values):
            return {}
        robot, faulty, name, by = self._asked(values)
        kind = faulty.fault_kinds[name]
        if math.isinf(faulty.begin_s(name)):
            return {}
        if kind.needs_hands and not faulty.is_in_reach_of_hands:
            sentence = f"{robot} is under water; {kind.title.lower()}: mended at the surface only"
            raise NodeError(NodeFault.REFUSED, sentence)
        faulty.mend(name)
        self._caused.pop((robot, name), None)
        self._publish()
        text = f"Mended in the simulator{_by(by)}: {kind.over} ({robot}, {name})."
        await self._announce(FaultNews(self._robot(robot), text, is_over=True))
        return {}

    def _robot(self, name: str) -> RobotId | None:
        return RobotId(name) if name in self._robots else None

    async def _came(self, robot: str, name: str, by: str) -> None:
        self._caused[robot, name] = _Caused(self._clock.now(), by)
        self._publish()
        words = self._faulty[robot].fault_kinds[name].words
        text = f"Caused in the simulator{_by(by)}: {words} ({robot}, {name})."
        await self._announce(FaultNews(self._robot(robot), text))

    def _asked(self, values: dict[str, Any]) -> tuple[str, Faulty, str, str]:
        robot, name = str(values.get("robot")), str(values.get("fault"))
        faulty = self._faulty.get(robot)
        if faulty is None:
            everywhere = [*self._faulty, *(one for told in self._away.values() for one in told)]
            there = ", ".join(everywhere) or "none yet"
            raise NodeError(NodeFault.UNKNOWN, f"no robot {robot} is simulated; there are {there}")
        if name not in faulty.fault_kinds:
            there = ", ".join(faulty.fault_kinds)
            raise NodeError(NodeFault.UNKNOWN, f"{robot} has no fault {name}; there are {there}")
        return robot, faulty, name, str(values.get("by", ""))[:_BY_MAX]

    def _publish(self) -> None:
        whole: dict[str, _Told] = {
            robot: {name: self._told(robot, name) for name in faulty.fault_kinds}
            for robot, faulty in self._faulty.items()
        }
        for told in self._away.values():
            whole.update(told)
        self.server.publish(FAULTS, _compact(whole), is_state=True)

    def _told(self, robot: str, name: str) -> Content:
        kind, caused = self._faulty[robot].fault_kinds[name], self._caused.get((robot, name))
        return {
            "title": kind.title,
            "words": kind.words,
            "since": None if caused is None else caused.since.isoformat(),
            "by": "" if caused is None else caused.by,
            "needs_hands": kind.needs_hands,
        }


_Told = Mapping[str, Content]
"""The faults of one robot by name, each with its words."""
_SHARED = ("title", "words", "needs_hands")
"""What the faults of one kind have in common; robots may be many, and a line is short."""


def _compact(robots: Mapping[str, _Told]) -> Content:
    """Return what is published: every kind once."""
    kinds: dict[tuple[Any, ...], int] = {}
    told: dict[str, dict[str, Content]] = {}
    for robot, faults in robots.items():
        told[robot] = {}
        for name, fault in faults.items():
            kind = kinds.setdefault(tuple(fault[key] for key in _SHARED), len(kinds))
            told[robot][name] = {"kind": kind, "since": fault["since"], "by": fault["by"]}
    shared = [dict(zip(_SHARED, kind, strict=True)) for kind in kinds]
    return {"kinds": shared, "robots": told}


def _whole(value: Content) -> dict[str, dict[str, Content]]:
    """Return the faults of each robot of what was published."""
    kinds = value["kinds"]
    return {
        robot: {
            name: {**kinds[fault["kind"]], "since": fault["since"], "by": fault["by"]}
            for name, fault in faults.items()
        }
        for robot, faults in value["robots"].items()
    }


def _by(who: str) -> str:
    return f" by {who}" if who else ""
