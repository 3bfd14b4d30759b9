"""Missions between a robot and ground stations of other makers, by the standard protocol."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from onboard.link.status_text import status_texts
from robot_link.mavlink.codec import WireMessage
from robot_link.mavlink.wire import grace
from robot_link.messages import SystemId
from robot_link.service.standard_item import StandardItem, standard_item

_MISSION = grace.MAV_MISSION_TYPE_MISSION
_MAX_ITEMS = 500
_KEEPS = "the plan on board stays: send another one"


@dataclass(frozen=True, slots=True)
class Asker:
    """Who speaks: a ground station and its component."""

    system: SystemId
    component: int


@dataclass(slots=True)
class _Transfer:
    count: int
    items: list[StandardItem]
    heard_s: float
    asked_s: float


@dataclass(frozen=True, slots=True)
class MissionVerdict:
    """What the robot says to a whole mission."""

    result: int = grace.MAV_MISSION_ACCEPTED
    """A MAV_MISSION_RESULT."""
    reason: str = ""
    """Why not, a sentence; where it is on board, how it differs from what was asked for, or ""."""


class MissionServer:
    """Takes missions from one asker, whole or not at all, and tells which one is on board.

    Args:
        asker: Whom to answer.
        take: Puts a mission on board.
        held: Returns the mission on board as standard items.
        answer_s: Time after which an item that stays away is asked for again.
        silence_s: Time after which the asker counts as gone.
    """

    def __init__(
        self,
        asker: Asker,
        take: Callable[[Sequence[StandardItem]], MissionVerdict],
        held: Callable[[], Sequence[StandardItem]],
        *,
        answer_s: float = 1.5,
        silence_s: float = 30.0,
    ) -> None:
        self._asker = asker
        self._take = take
        self._held = held
        self._answer_s = answer_s
        self._silence_s = silence_s
        self._transfer: _Transfer | None = None
        self._ended: int | None = None

    def hear(self, message: WireMessage, now_s: float) -> list[WireMessage]:
        """Return what to answer; nothing to what is not of missions."""
        if getattr(message, "mission_type", _MISSION) != _MISSION:
            return self._other_kind(message)
        match message:
            case grace.MAVLink_mission_count_message():
                return self._begin(message.count, now_s)
            case grace.MAVLink_mission_item_int_message():
                return self._item(message, now_s)
            case grace.MAVLink_mission_request_list_message():
                return [self._count(_MISSION, len(self._held()))]
            case (
                grace.MAVLink_mission_request_int_message()
                | grace.MAVLink_mission_request_message()
            ):
                held = self._held()
                if message.seq >= len(held):
                    return [self._ack(grace.MAV_MISSION_INVALID_SEQUENCE)]
                system, component = self._asker.system, self._asker.component
                return [held[message.seq].message(message.seq, system, component)]
            case grace.MAVLink_mission_ack_message():
                self._transfer = None
                return []
            case grace.MAVLink_mission_clear_all_message():
                return self._end(MissionVerdict(grace.MAV_MISSION_DENIED, _KEEPS))
            case _:
                return []

    def tick(self, now_s: float) -> list[WireMessage]:
        """Ask again for an item that stays away; forget an asker that fell silent."""
        transfer = self._transfer
        if transfer is None:
            return []
        if now_s - transfer.heard_s > self._silence_s:
            self._transfer = None
            return []
        return self._request(now_s) if now_s - transfer.asked_s >= self._answer_s else []

    def _begin(self, count: int, now_s: float) -> list[WireMessage]:
        self._ended = None
        if not 1 <= count <= _MAX_ITEMS:
            reason = f"a mission has 1 to {_MAX_ITEMS} items, not {count}"
            return self._end(MissionVerdict(grace.MAV_MISSION_NO_SPACE, reason))
        under_way = self._transfer
        if under_way is None or under_way.count != count:
            self._transfer = _Transfer(count, [], now_s, now_s)
        elif under_way.items:
            # the same sender begins anew, with another mission for all that is known here
            under_way.items.clear()
        return self._request(now_s)

    def _item(
        self, message: grace.MAVLink_mission_item_int_message, now_s: float
    ) -> list[WireMessage]:
        transfer = self._transfer
        if transfer is None:
            return [] if self._ended is None else [self._ack(self._ended)]
        transfer.heard_s = now_s
        if message.seq != len(transfer.items):
            return self.tick(now_s)
        transfer.items.append(standard_item(message))
        if len(transfer.items) < transfer.count:
            return self._request(now_s)
        return self._end(self._take(transfer.items))

    def _end(self, verdict: MissionVerdict) -> list[WireMessage]:
        self._transfer, self._ended = None, verdict.result
        answers: list[WireMessage] = [self._ack(verdict.result)]
        if verdict.reason:
            answers += status_texts(verdict.reason)
        return answers

    def _request(self, now_s: float) -> list[WireMessage]:
        if (transfer := self._transfer) is None:
            return []
        transfer.asked_s = now_s
        return [
            grace.MAVLink_mission_request_int_message(
                target_system=self._asker.system,
                target_component=self._asker.component,
                seq=len(transfer.items),
                mission_type=_MISSION,
            )
        ]

    def _other_kind(self, message: WireMessage) -> list[WireMessage]:
        """Answer of fences and rally points, which robots here do not have."""
        match message:
            case grace.MAVLink_mission_request_list_message():
                return [self._count(message.mission_type, 0)]
            case grace.MAVLink_mission_count_message():
                return [self._ack(grace.MAV_MISSION_UNSUPPORTED, message.mission_type)]
            case _:
                return []

    def _count(self, kind: int, count: int) -> WireMessage:
        return grace.MAVLink_mission_count_message(
            target_system=self._asker.system,
            target_component=self._asker.component,
            count=count,
            mission_type=kind,
        )

    def _ack(self, result: int, kind: int = _MISSION) -> WireMessage:
        return grace.MAVLink_mission_ack_message(
            target_system=self._asker.system,
            target_component=self._asker.component,
            type=result,
            mission_type=kind,
        )
