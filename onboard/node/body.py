"""The body node: readings of all sensors ten times a second, and set points for the actuators.

| question | values | answer |
|---|---|---|
| actuate | the fields of ``SetPoints`` | |
| read | | what ``readings`` published last |

Topic ``readings``: the fields of ``Readings``, with ``count_s`` (the robot's counter at that
moment), ``field`` (one measurement of what is being mapped, in its unit; null of a dead sensor),
``instruments`` (of each other, by its channel, how often it wants to be asked, s), ``measured`` (a
measurement of each that answers) and ``condition`` (readings of the robot itself by the keys of
their channels).
"""

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict, fields
from typing import Any

from onboard.flight.hardware import Hardware, Readings, SetPoints
from onboard.node.client import NodeClient, Subscription
from onboard.node.server import NodeServer
from onboard.node.wire import Content, NodeError, NodeFault

READINGS = "readings"
_WAITING = 50
"""Sets of readings that wait for a program that is late: each may hold a fix."""
_SET_POINTS = frozenset(field.name for field in fields(SetPoints))


class BodyNode:
    """Serves a body to any number of programs; the last set points of any of them hold.

    Args:
        hardware: The body.
        count_s: The robot's counter now.
    """

    def __init__(self, hardware: Hardware, count_s: Callable[[], float]) -> None:
        self._hardware = hardware
        self._count_s = count_s
        self._newest: Content | None = None
        self.server = NodeServer(
            "body", {"actuate": self._actuate, "read": self._read}, (READINGS,)
        )

    def publish(self) -> None:
        """Read the sensors and tell everyone."""
        self._newest = {
            **asdict(self._hardware.read()),
            "count_s": self._count_s(),
            "field": self._hardware.measure_field(),
            "instruments": dict(self._hardware.instruments),
            "measured": dict(self._hardware.measure(self._hardware.instruments)),
            "condition": dict(self._hardware.condition()),
        }
        self.server.publish(READINGS, self._newest, is_state=True)

    async def _read(self, _values: dict[str, Any]) -> Content:
        if self._newest is None:
            raise NodeError(NodeFault.REFUSED, "the sensors have not been read yet")
        return self._newest

    async def _actuate(self, values: dict[str, Any]) -> Content:
        unknown = set(values) - _SET_POINTS
        are_numbers = all(isinstance(value, int | float) for value in values.values())
        if unknown or not are_numbers or not all(map(math.isfinite, values.values())):
            raise ValueError(f"set points are numbers named {', '.join(sorted(_SET_POINTS))}")
        self._hardware.actuate(SetPoints(**values))
        return {}


class RemoteBody:
    """A body behind its node, as the ``Hardware`` of an onboard program.

    The program is stepped once for each set of readings: ``wait``, step, ``push``.
    """

    def __init__(self, node: NodeClient) -> None:
        self._node = node
        self._readings: Subscription = node.subscribe(READINGS, _WAITING)
        self._newest: Readings | None = None
        self._field: float | None = None
        self._instruments: Mapping[str, float] = {}
        self._measured: Mapping[str, float] = {}
        self._condition: Mapping[str, float] = {}
        self._wanted: SetPoints | None = None
        self.count_s = 0.0
        """The robot's counter when the newest readings were taken."""

    async def wait(self) -> None:
        """Wait for the next readings."""
        value = dict(await self._readings.get())
        self.count_s, self._field = value.pop("count_s"), value.pop("field")
        self._instruments = value.pop("instruments", {})
        self._measured = value.pop("measured", {})
        self._condition = value.pop("condition", {})
        fix = value.pop("fix_ne_m")
        gyro = tuple(value.pop("gyro_rad_s"))
        self._newest = Readings(
            fix_ne_m=None if fix is None else tuple(fix), gyro_rad_s=gyro, **value
        )

    async def push(self) -> None:
        """Give the actuators what the program wanted last.

        Raises:
            NodeError: If the node refuses.
            NodeGoneError: If there is no connection.
            NodeSilentError: If the node does not answer.
        """
        if self._wanted is not None:
            await self._node.ask("actuate", **asdict(self._wanted))

    def read(self) -> Readings:
        """Return the newest readings of all sensors.

        Raises:
            RuntimeError: If there were none yet: ``wait`` first.
        """
        if self._newest is None:
            raise RuntimeError("the body has not been heard yet")
        return self._newest

    def measure_field(self) -> float | None:
        """Return the newest measurement of the field, in the variable's unit, if there is one."""
        return self._field

    @property
    def instruments(self) -> Mapping[str, float]:
        """How often each further instrument wants to be asked, s, by its channel."""
        return self._instruments

    def measure(self, channels: Iterable[str]) -> Mapping[str, float]:
        """Return the newest measurement of each of these channels that there is."""
        return {key: self._measured[key] for key in channels if key in self._measured}

    def condition(self) -> Mapping[str, float]:
        """Return the newest readings of the robot itself."""
        return self._condition

    def actuate(self, command: SetPoints) -> None:
        """Note set points; ``push`` sends them."""
        self._wanted = command
