"""Standard MAVLink missions of other makers' vehicles, sent and fetched by the station."""

import asyncio
from collections.abc import Callable, Sequence

from robot_link.clock import monotonic_s
from robot_link.mavlink.codec import WireMessage
from robot_link.mavlink.wire import grace
from robot_link.service.standard_item import RESULTS, StandardItem, standard_item
from robot_link.station.error import NoAnswerError, ServiceRefusedError
from robot_link.station.exchange import Correspondent, Exchange, Listening, Patience

_Request = grace.MAVLink_mission_request_int_message | grace.MAVLink_mission_request_message
_Ack = grace.MAVLink_mission_ack_message

_MISSION = grace.MAV_MISSION_TYPE_MISSION
_TOTAL_S = 30.0
_ITEM_S = 0.5
_STARTS = 3
"""How often a transfer that broke off is begun anew."""


class MissionClient:
    """One transfer at a time. Whoever asks for items goes on with the next one after a silence.

    This project's own robots take missions by their hash (``robot_link.station.upload``); a
    vehicle that knows no hash proves what it holds by being read back.
    """

    def __init__(
        self,
        peer: Correspondent,
        *,
        component: int = grace.MAV_COMP_ID_AUTOPILOT1,
        patience: Patience | None = None,
    ) -> None:
        self._exchange = Exchange(peer, patience)
        self._component = component
        self._in_use = asyncio.Lock()

    def hear(self, message: WireMessage) -> None:
        """Take what the vehicle says."""
        self._exchange.hear(message)

    async def upload(
        self,
        items: Sequence[StandardItem],
        *,
        report: Callable[[int, int], None] = lambda _sent, _count: None,
    ) -> None:
        """Put a mission on board; the vehicle's ACCEPTED ends it.

        Args:
            items: The mission; item 0 is flown to first.
            report: Called with how many items the vehicle has, and how many there are.

        Raises:
            NoAnswerError: If the vehicle fell silent; which mission it holds is not known then.
            ServiceRefusedError: If it refused; the sentence says why.
        """
        async with self._in_use:
            ends_s = monotonic_s() + _TOTAL_S + _ITEM_S * len(items)
            for _ in range(_STARTS):
                try:
                    await self._hand_out(items, ends_s, report)
                except NoAnswerError:
                    if monotonic_s() >= ends_s:
                        raise
                else:
                    report(len(items), len(items))
                    return
        raise NoAnswerError("the robot did not ask for the mission to its end")

    async def download(
        self, *, report: Callable[[int, int], None] = lambda _got, _count: None
    ) -> tuple[StandardItem, ...]:
        """Return the mission on board.

        Args:
            report: Called with how many items are here, and how many there are.

        Raises:
            NoAnswerError: If the vehicle fell silent.
            ServiceRefusedError: If it refused.
        """
        async with self._in_use:
            asked = grace.MAVLink_mission_request_list_message(
                target_system=self._exchange.system,
                target_component=self._component,
                mission_type=_MISSION,
            )
            count = await self._exchange.ask(lambda _: (asked,), _count_or_refusal)
            items: list[StandardItem] = []
            while len(items) < count:
                report(len(items), count)
                items.append(await self._item(len(items)))
            await self._exchange.say((self._ack(grace.MAV_MISSION_ACCEPTED),))
            report(count, count)
        return tuple(items)

    async def verify(self, items: Sequence[StandardItem]) -> None:
        """Read the mission back and compare it.

        Raises:
            NoAnswerError: If the vehicle fell silent.
            ServiceRefusedError: If what it holds is another mission; the sentence names the item.
        """
        held = await self.download()
        if len(held) != len(items):
            raise ServiceRefusedError(f"the robot holds {len(held)} items, not {len(items)}")
        for number, (kept, sent) in enumerate(zip(held, items, strict=True)):
            if not kept.is_same(sent):
                raise ServiceRefusedError(f"item {number} on board is not the one that was sent")

    async def _hand_out(
        self, items: Sequence[StandardItem], ends_s: float, report: Callable[[int, int], None]
    ) -> None:
        said: WireMessage = grace.MAVLink_mission_count_message(
            target_system=self._exchange.system,
            target_component=self._component,
            count=len(items),
            mission_type=_MISSION,
        )
        silences = 0
        with self._exchange.listen() as inbox:
            await self._exchange.say((said,))
            while True:
                heard = await self._next_word(inbox, ends_s)
                match heard:
                    case None:
                        silences += 1
                        if silences >= self._exchange.patience.attempts or monotonic_s() >= ends_s:
                            raise NoAnswerError("the robot did not answer to the mission")
                    case grace.MAVLink_mission_ack_message():
                        if heard.type == grace.MAV_MISSION_ACCEPTED:
                            return
                        reason = RESULTS.get(heard.type, "it gives no reason")
                        raise ServiceRefusedError(f"the robot refused the mission: {reason}")
                    case _:
                        if heard.seq >= len(items):
                            continue
                        silences = 0
                        report(heard.seq, len(items))
                        item = items[heard.seq]
                        said = item.message(heard.seq, self._exchange.system, self._component)
                await self._exchange.say((said,))

    async def _next_word(self, inbox: Listening, ends_s: float) -> _Request | _Ack | None:
        wait_s = min(self._exchange.wait_s, ends_s - monotonic_s())
        try:
            return await inbox.first(_request_or_ack, wait_s)
        except TimeoutError:
            return None

    async def _item(self, sequence: int) -> StandardItem:
        asked = grace.MAVLink_mission_request_int_message(
            target_system=self._exchange.system,
            target_component=self._component,
            seq=sequence,
            mission_type=_MISSION,
        )

        def answer(message: WireMessage) -> StandardItem | None:
            is_it = isinstance(message, grace.MAVLink_mission_item_int_message)
            if is_it and message.seq == sequence and message.mission_type == _MISSION:
                return standard_item(message)
            _check_refusal(message)
            return None

        return await self._exchange.ask(lambda _: (asked,), answer, about=f"for item {sequence}")

    def _ack(self, result: int) -> WireMessage:
        return grace.MAVLink_mission_ack_message(
            target_system=self._exchange.system,
            target_component=self._component,
            type=result,
            mission_type=_MISSION,
        )


def _request_or_ack(message: WireMessage) -> _Request | _Ack | None:
    match message:
        case (
            grace.MAVLink_mission_request_int_message()
            | grace.MAVLink_mission_request_message()
            | grace.MAVLink_mission_ack_message()
        ):
            return message if message.mission_type == _MISSION else None
        case _:
            return None


def _count_or_refusal(message: WireMessage) -> int | None:
    if isinstance(message, grace.MAVLink_mission_count_message):
        return message.count if message.mission_type == _MISSION else None
    _check_refusal(message)
    return None


def _check_refusal(message: WireMessage) -> None:
    is_ack = isinstance(message, grace.MAVLink_mission_ack_message)
    if is_ack and message.type != grace.MAV_MISSION_ACCEPTED:
        reason = RESULTS.get(message.type, "it gives no reason")
        raise ServiceRefusedError(f"the robot does not give its mission: {reason}")
