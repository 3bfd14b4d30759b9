"""The receiving end of a mission upload, without input or output: staging and the hash.

Nothing touches the plan on board before every item is there and their hash is the offered one.
"""

from dataclasses import dataclass

from robot_link.mavlink.mission_item import MissionItem, mission_from_items
from robot_link.messages import PlanHash
from robot_link.mission import Mission


@dataclass(frozen=True, slots=True)
class Request:
    """Ask for this item."""

    sequence: int


@dataclass(frozen=True, slots=True)
class Complete:
    """All items are there and are the mission that was offered."""

    sha256: PlanHash
    mission: Mission


@dataclass(frozen=True, slots=True)
class Refused:
    """The items are not the mission that was offered."""

    sha256: PlanHash
    reason: str


Step = Request | Complete | Refused


class MissionReceiver:
    """Collects one mission at a time; another offer replaces one that is not complete.

    The same offer again goes on where the first stopped, so a sender that was restarted, or that
    lost an answer, just begins again.
    """

    def __init__(self, answer_s: float, silence_s: float) -> None:
        """Set wall times: to the next request for the same item, and to giving up."""
        self._answer_s = answer_s
        self._silence_s = silence_s
        self._sha256: PlanHash | None = None
        self._count = 0
        self._items: list[MissionItem] = []
        self._heard_s = 0.0
        self._asked_s = 0.0

    @property
    def is_receiving(self) -> bool:
        """Whether a mission was offered and is not complete."""
        return self._sha256 is not None

    def is_offered(self, count: int) -> bool:
        """Tell whether a mission of so many items was offered."""
        return self.is_receiving and count == self._count

    def offer(self, sha256: PlanHash, count: int, now_s: float) -> None:
        """Prepare for a mission of ``count`` items."""
        if (sha256, count) != (self._sha256, self._count):
            self._sha256, self._count, self._items = sha256, count, []
        self._heard_s = now_s

    def count(self, count: int, now_s: float) -> Request | None:
        """Begin to ask for items; None where no mission of this count was offered."""
        if self._sha256 is None or count != self._count or count < 1:
            return None
        self._heard_s = now_s
        return self._request(now_s)

    def item(self, item: MissionItem, now_s: float) -> Step | None:
        """Take an item; None where it is not the one that was asked for."""
        if self._sha256 is None or item.seq != len(self._items):
            return None
        self._heard_s = now_s
        self._items.append(item)
        if len(self._items) < self._count:
            return self._request(now_s)
        sha256, items = self._sha256, self._items
        self.forget()
        try:
            mission = mission_from_items(items)
            is_offered = mission.sha256() == sha256
        except ValueError as error:
            return Refused(sha256, str(error))
        if not is_offered:
            return Refused(sha256, "the items are not the mission that was offered")
        return Complete(sha256, mission)

    def tick(self, now_s: float) -> Request | None:
        """Ask again for an item that stays away; give up where the sender fell silent."""
        if self._sha256 is None:
            return None
        if now_s - self._heard_s > self._silence_s:
            self.forget()
            return None
        return self._request(now_s) if now_s - self._asked_s >= self._answer_s else None

    def forget(self) -> None:
        """Drop what is staged."""
        self._sha256, self._count, self._items = None, 0, []

    def _request(self, now_s: float) -> Request:
        self._asked_s = now_s
        return Request(len(self._items))
