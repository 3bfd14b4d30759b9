"""Which ground station is in control of the robot, as MAVLink's other stations see and ask it."""

import asyncio
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final

from onboard.link.mission_server import Asker
from robot_link.clock import monotonic_s, set_or_after
from robot_link.mavlink.codec import STATION_SYSTEM, WireMessage
from robot_link.mavlink.operator_control import (
    NOBODY,
    ControlWish,
    answer,
    passed_on,
    status_message,
    wish_of,
)
from robot_link.mavlink.wire import grace
from robot_link.messages import SystemId
from robot_link.transport.datagram import Address

_STATION_EVERY: Final = 5
"""The robot's own station hears of it at every change, and else at each so manieth period."""
_OWN_STATION: Final = "the robot's own station holds it"
_ANOTHER: Final = "another ground station is in control of the robot"
Say = Callable[[Address | None, WireMessage], None]


@dataclass(slots=True)
class _Pending:
    """A request that the robot's own station has not decided."""

    asker: Asker
    wish: ControlWish
    until_s: float
    is_heard: bool = False
    """Whether the station said that it got it."""


class OperatorDesk:
    """Manages the control of the robot; on one event loop.

    While its own station is heard, that decides who is in control: what another asks is passed on
    to it, and what it does not answer in time is refused. Who is in control and falls silent is so
    no more. While the own station is silent the first who asks is in control, until it comes back.
    Nothing of this is kept over a restart, after which the own station is in control.

    Args:
        is_station_heard: Tells whether the robot's own station is heard.
        guests: Returns the other ground stations that are heard, with their radios.
        say: Sends to a radio; to the robot's own station where that is None.
        period_s: Time between two words on who is in control, s of the wall.
    """

    def __init__(
        self,
        is_station_heard: Callable[[], bool],
        guests: Callable[[], Mapping[Asker, Address]],
        say: Say,
        period_s: float,
    ) -> None:
        self._is_station_heard = is_station_heard
        self._guests = guests
        self._say = say
        self._period_s = period_s
        self._granted: Asker | None = None
        """To whom the robot's own station gave it."""
        self._claimed: Asker | None = None
        """Who took it while that station was silent."""
        self._pending: _Pending | None = None
        self._allows_takeover = False
        self._told: WireMessage | None = None
        self._periods = 0
        self._stirred = asyncio.Event()

    @property
    def controller(self) -> SystemId:
        """Who is in control; 0 for nobody."""
        guests = self._guests()
        if self._granted is not None and self._granted in guests:
            return self._granted.system
        if self._is_station_heard():
            return STATION_SYSTEM
        if self._claimed is not None and self._claimed in guests:
            return self._claimed.system
        return NOBODY

    def refusal(self, system: SystemId) -> str:
        """Return why a ground station may change nothing now; "" where it may."""
        controller = self.controller
        if system == STATION_SYSTEM or controller in (system, NOBODY):
            return ""
        return _OWN_STATION if controller == STATION_SYSTEM else _ANOTHER

    def command(self, asker: Asker, message: grace.MAVLink_command_long_message) -> int:
        """Take a MAV_CMD_REQUEST_OPERATOR_CONTROL and return its result."""
        try:
            wish = wish_of(message)
        except ValueError:
            return grace.MAV_RESULT_DENIED
        self._stirred.set()
        if asker.system == STATION_SYSTEM:
            return self._decide(wish)
        if wish.system not in (NOBODY, asker.system):
            return grace.MAV_RESULT_DENIED  # nobody asks for another
        return self._ask(asker, wish) if wish.is_request else self._give_back(asker, wish)

    def answered(self, message: grace.MAVLink_command_ack_message) -> None:
        """Take what the robot's own station says to a request that was passed on."""
        pending = self._pending
        if pending is None or message.result_param2 not in (NOBODY, pending.asker.system):
            return
        if message.result in (grace.MAV_RESULT_ACCEPTED, grace.MAV_RESULT_IN_PROGRESS):
            pending.is_heard = True
        else:
            self._settle(message.result)

    async def run(self) -> None:
        """Tell who is in control, and end what nobody answers, until cancelled."""
        while True:
            self._stirred.clear()
            self._tick(monotonic_s())
            await set_or_after(self._stirred, self._period_s)

    def _decide(self, wish: ControlWish) -> int:
        self._allows_takeover = wish.allows_takeover
        if wish.system in (NOBODY, STATION_SYSTEM):
            self._granted = None
            return grace.MAV_RESULT_ACCEPTED
        chosen = next((one for one in self._guests() if one.system == wish.system), None)
        if chosen is None:
            return grace.MAV_RESULT_DENIED
        self._granted = chosen
        if self._pending is not None and self._pending.asker.system == chosen.system:
            self._settle(grace.MAV_RESULT_ACCEPTED)
        return grace.MAV_RESULT_ACCEPTED

    def _ask(self, asker: Asker, wish: ControlWish) -> int:
        controller = self.controller
        if controller == asker.system:
            return grace.MAV_RESULT_ACCEPTED
        if controller == NOBODY:
            self._claimed = asker
            return grace.MAV_RESULT_ACCEPTED
        if controller != STATION_SYSTEM:
            return grace.MAV_RESULT_TEMPORARILY_REJECTED
        if self._pending is None:
            asked = ControlWish(True, wish.allows_takeover, wish.stands_s, asker.system)
            self._pending = _Pending(asker, asked, monotonic_s() + wish.stands_s)
        elif self._pending.asker.system != asker.system:
            return grace.MAV_RESULT_TEMPORARILY_REJECTED
        return grace.MAV_RESULT_IN_PROGRESS

    def _give_back(self, asker: Asker, wish: ControlWish) -> int:
        asks = self._pending is not None and self._pending.asker.system == asker.system
        if asks:
            self._pending = None
        elif self.controller == asker.system:
            self._granted = self._claimed = None
        else:
            return grace.MAV_RESULT_DENIED
        self._say(None, passed_on(ControlWish(False, False, wish.stands_s, asker.system)))
        return grace.MAV_RESULT_ACCEPTED

    def _settle(self, result: int) -> None:
        """Give who asked the last word on it."""
        pending, self._pending = self._pending, None
        if pending is None:
            return
        self._stirred.set()
        asker = pending.asker
        if (address := self._guests().get(asker)) is not None:
            self._say(address, answer(result, asker.system, asker.component))

    def _tick(self, now_s: float) -> None:
        guests = self._guests()
        if self._granted not in guests:
            self._granted = None
        if self._claimed not in guests or self._is_station_heard():
            self._claimed = None
        if self._pending is not None and now_s >= self._pending.until_s:
            self._settle(grace.MAV_RESULT_TEMPORARILY_REJECTED)
        if self._pending is not None and not self._pending.is_heard:
            self._say(None, passed_on(self._pending.wish))
        self._tell(guests)

    def _tell(self, guests: Mapping[Asker, Address]) -> None:
        controller = self.controller
        allows = self._allows_takeover if controller == STATION_SYSTEM else controller == NOBODY
        status = status_message(controller, allows_takeover=allows)
        is_new = self._told is None or status.to_dict() != self._told.to_dict()
        if is_new or self._periods % _STATION_EVERY == 0:
            self._say(None, status)
        for address in set(guests.values()):
            self._say(address, status)
        self._periods += 1
        self._told = status
