"""The health of every link, told when it changes and now and then."""

import asyncio
from collections.abc import Callable
from dataclasses import replace

from robot_link.messages import LinkReport, LinkState, RobotId
from robot_link.station.roster import Member, Roster


class LinkWatch:
    """Completes the reports of a robot's links by what is known of it by whatever link."""

    def __init__(self, roster: Roster, on_report: Callable[[LinkReport], None]) -> None:
        self._roster = roster
        self._on_report = on_report
        self._told: dict[tuple[RobotId, str], LinkState] = {}
        roster.on_conflict = self.tell_now

    def best(self, member: Member) -> LinkReport:
        """Return the report of the best link to a robot."""
        return self._completed(member, member.peer.link_report())

    def reports(self, member: Member) -> list[LinkReport]:
        """Return the reports of all links to a robot, the preferred one first."""
        return [self._completed(member, report) for report in member.peer.link_reports()]

    def tell_changes(self, member: Member) -> None:
        """Tell of each link whose state is another than what was told last."""
        for report in member.peer.link_reports():
            if self._told.get((member.robot, report.uri)) is not report.state:
                self._tell(self._completed(member, report))

    def tell_now(self, member: Member) -> None:
        """Tell of each link, for what cannot wait."""
        for report in self.reports(member):
            self._tell(report)

    def tell_all_changes(self) -> None:
        """Tell of every link of every robot that changed."""
        for member in self._roster:
            self.tell_changes(member)

    async def run(self, period_s: float) -> None:
        """Tell of every link once in a while until cancelled."""
        while True:
            for member in self._roster:
                self.tell_now(member)
            await asyncio.sleep(period_s)

    def _completed(self, member: Member, report: LinkReport) -> LinkReport:
        offset = member.services.clock.offset
        conflict = self._roster.conflict(member)
        signing = member.signing
        troubles = (
            conflict,
            "" if signing is None else signing.fault,
            self._roster.unproved(member),
            "" if offset is None else offset.sentence,
        )
        return replace(
            report,
            clock_offset_s=None if offset is None else offset.offset_s,
            trouble="; ".join(trouble for trouble in troubles if trouble),
            conflict=conflict,
            is_signed=signing is not None,
        )

    def _tell(self, report: LinkReport) -> None:
        self._told[report.robot, report.uri] = report.state
        self._on_report(report)
