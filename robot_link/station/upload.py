"""One mission upload, the station's end."""

import asyncio
from collections.abc import Callable

from robot_link.clock import monotonic_s
from robot_link.mavlink.mission_item import mission_items
from robot_link.mavlink.telemetry import hash_octets
from robot_link.mavlink.wire import grace
from robot_link.messages import OnboardPlanState, PlanReport, UploadReport
from robot_link.mission import Mission
from robot_link.station.peer import Peer

UploadMessage = grace.MAVLink_mission_request_int_message | PlanReport


class Upload:
    """Offers a mission, hands out the items that the robot asks for, and waits for its word.

    The robot drives the transfer, and nothing but its own word on the hash proves it: the standard
    MISSION_ACK is not waited for, and an early refusal in it ends nothing. Whenever it falls
    silent the offer is repeated; the robot goes on where it stopped, begins again if it was
    restarted, or says that the plan is on board.
    """

    def __init__(
        self,
        peer: Peer,
        mission: Mission,
        on_report: Callable[[UploadReport], None],
        *,
        may_wait: bool = False,
    ) -> None:
        self._peer = peer
        self._may_wait = may_wait
        self._items = mission_items(mission, peer.system)
        self._sha256 = mission.sha256()
        self._on_report = on_report
        self._inbox: asyncio.Queue[UploadMessage | str] = asyncio.Queue()
        self._proved = 0
        self._has_begun = False

    def hear(self, message: UploadMessage) -> None:
        """Take what the robot says of missions and plans."""
        self._inbox.put_nowait(message)

    def cancel(self, reason: str) -> None:
        """End as FAILED for this reason."""
        self._inbox.put_nowait(reason)

    async def run(self) -> UploadReport:
        """Return the last report, which was also told like the ones before.

        RECEIVING is told from the moment that the radio has taken the first offer.
        """
        timing = self._peer.timing
        ends_s = monotonic_s() + timing.upload_s + timing.upload_item_s * len(self._items)
        await self._offer()
        while (left_s := ends_s - monotonic_s()) > 0:
            try:
                async with asyncio.timeout(min(timing.answer_s, left_s)):
                    message = await self._inbox.get()
            except TimeoutError:
                await self._offer()
                continue
            if isinstance(message, str):
                return self._tell(OnboardPlanState.FAILED, message)
            if (last := await self._answer(message)) is not None:
                return last
        how_far = f" after {self._proved} of {len(self._items)} items" if self._proved else ""
        return self._tell(OnboardPlanState.FAILED, f"no answer from the robot{how_far}")

    async def _offer(self) -> None:
        offer = grace.MAVLink_grace_plan_offer_message(
            items=len(self._items),
            target_system=self._peer.system,
            sha256=hash_octets(self._sha256),
            may_wait=int(self._may_wait),
        )
        count = grace.MAVLink_mission_count_message(
            target_system=self._peer.system,
            target_component=grace.MAV_COMP_ID_AUTOPILOT1,
            count=len(self._items),
            mission_type=grace.MAV_MISSION_TYPE_MISSION,
        )
        await self._peer.deliver((offer, count), on_taken=self._begin)

    def _begin(self) -> None:
        if not self._has_begun:
            self._has_begun = True
            self._tell(OnboardPlanState.RECEIVING)

    async def _answer(self, message: UploadMessage) -> UploadReport | None:
        match message:
            case grace.MAVLink_mission_request_int_message(seq=sequence):
                if sequence < len(self._items):
                    if sequence > self._proved:
                        self._proved = sequence
                        self._tell(OnboardPlanState.RECEIVING)
                    await self._peer.deliver((self._items[sequence],))
            case PlanReport():
                if message.sha256 != self._sha256:
                    return None
                if message.state in (OnboardPlanState.ON_BOARD, OnboardPlanState.RUNNING):
                    self._proved = len(self._items)
                    return self._tell(OnboardPlanState.ON_BOARD)
                if message.state == OnboardPlanState.WAITING:
                    self._proved = len(self._items)
                    return self._tell(OnboardPlanState.WAITING)
                if message.state == OnboardPlanState.REFUSED:
                    return self._tell(OnboardPlanState.REFUSED, message.reason)
        return None

    def _tell(self, state: OnboardPlanState, reason: str = "") -> UploadReport:
        report = UploadReport(
            robot=self._peer.robot,
            sha256=self._sha256,
            items_sent=self._proved,
            items=len(self._items),
            state=state,
            reason=reason,
            at=self._peer.clock.now(),
        )
        self._on_report(report)
        return report
