"""What a station tells its robot of who is to be in control of it; see ``operator_control``."""

import asyncio

from robot_link.mavlink.codec import ROBOT_COMPONENT, STATION_SYSTEM, WireMessage
from robot_link.mavlink.operator_control import STANDS_S, ControlWish, answer, decision
from robot_link.mavlink.wire import grace
from robot_link.messages import SystemId
from robot_link.station.peer import Peer

_WAITING: int = 16


class ControlSpeaker:
    """Sends each word once; whoever decides says it again while the robot tells otherwise."""

    def __init__(self, peer: Peer) -> None:
        self._peer = peer
        self._words: asyncio.Queue[WireMessage] = asyncio.Queue(_WAITING)

    def give(self, system: SystemId, *, allows_takeover: bool) -> None:
        """Say who is to be in control; the station itself is ``STATION_SYSTEM``."""
        is_own = system == STATION_SYSTEM
        wish = ControlWish(True, allows_takeover and is_own, STANDS_S[0], system)
        self._say(decision(self._peer.system, wish))

    def answer(self, system: SystemId, *, is_heard: bool) -> None:
        """Answer what another ground station asked by the robot: it is heard, or refused."""
        result = grace.MAV_RESULT_IN_PROGRESS if is_heard else grace.MAV_RESULT_DENIED
        self._say(answer(result, self._peer.system, ROBOT_COMPONENT, system))

    async def run(self) -> None:
        """Send until cancelled."""
        while True:
            word = await self._words.get()
            await self._peer.deliver((word,))

    def _say(self, word: WireMessage) -> None:
        if self._words.full():  # a radio that is stuck; the newest word counts
            self._words.get_nowait()
        self._words.put_nowait(word)
