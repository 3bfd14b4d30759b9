"""Who drives which robot by hand, and the newest stick on its way."""

import asyncio
from dataclasses import dataclass
from datetime import datetime
from typing import Final, Literal, Protocol

from db.query.station.events import add_event
from robot_link.clock import monotonic_s
from robot_link.drive import CENTRE, RELEASE_S, SILENCE_S, Stick
from robot_link.messages import RobotId
from robot_link.station.drive_client import DriveAnswer, DriveClient
from robot_link.station.error import ServiceError
from server.base.foundation import Foundation
from server.base.problem import conflict
from server.base.retry_queue import until_stored
from server.drive.latency import LatencyWatch
from server.drive.view import DriveView, RobotAnswerView, StickView
from server.fleet.capability import drive_refusal, refuse_unless_able
from server.fleet.dependency import refuse_recording
from server.fleet.fleet import Fleet
from server.fleet.words import sentence
from server.lease.hold import HoldChanged
from server.lease.state import LeaseChanged

State = Literal["beginning", "driving", "ended"]
_CANNOT: Final = "the robot cannot do this now"


class DriveRadio(Protocol):
    """The part of the links by which robots are driven."""

    def drive(self, robot: RobotId) -> DriveClient:
        """Return what drives a robot; ServiceError if it is not in radio contact."""
        ...


@dataclass(frozen=True, slots=True)
class Heard:
    """The newest answer of a robot, and when it came by the wall."""

    answer: DriveAnswer
    at_s: float


class Drive:
    """One person drives one robot, from a begin to an end. Belongs to one event loop.

    Args:
        robot: Which one.
        driver: Who.
        client: What reaches it.
        begun_at: The clock now.
        answers_sticks: Whether it answers each stick; vehicles of other makers do not.
        is_script: Whether the driver is a program.
    """

    def __init__(
        self,
        robot: RobotId,
        driver: str,
        client: DriveClient,
        begun_at: datetime,
        *,
        answers_sticks: bool,
        is_script: bool = False,
    ) -> None:
        self.robot, self.driver, self.begun_at = robot, driver, begun_at
        self.is_script = is_script
        self.client = client
        self.latency = LatencyWatch()
        self.state: State = "beginning"
        self.reason = ""
        """Why it ended, one sentence."""
        self.dropped = 0
        self.heard: Heard | None = None
        self.changed = asyncio.Event()
        """Set when there is something new to tell the pilot."""
        self._answers_sticks = answers_sticks
        self._newest: tuple[Stick, int] | None = None
        self._stirred = asyncio.Event()
        client.on_answer = self._hear

    def steer(self, stick: Stick, number: int) -> None:
        """Take where the stick is now; one that is not sent yet is forgotten."""
        self.dropped += self._newest is not None
        self._newest = stick, number
        self._stirred.set()

    def end(self, reason: str) -> None:
        """Let it end with a sentence; the first one holds."""
        if self.state != "ended":
            self.state, self.reason = "ended", reason
        self._stirred.set()
        self.changed.set()

    async def run(self) -> None:
        """Send the newest stick whenever the radio is free, until the drive has ended.

        A pilot who says nothing is not spoken for: the robot stops by itself. A vehicle of another
        maker, whose own rules for that are not known, is told that the stick is in the middle.
        """
        silent_since_s, number = monotonic_s(), 0
        while self.state != "ended":
            try:
                async with asyncio.timeout(SILENCE_S):
                    await self._stirred.wait()
            except TimeoutError:
                if monotonic_s() - silent_since_s > RELEASE_S:
                    self.end(f"No stick came for {RELEASE_S:.0f} s.")
                elif not self._answers_sticks:
                    await self.client.steer(CENTRE, number)
                continue
            self._stirred.clear()
            if self._newest is None:
                continue
            (stick, number), self._newest = self._newest, None
            silent_since_s = monotonic_s()
            await self.client.steer(stick, number)

    def _hear(self, answer: DriveAnswer) -> None:
        self.latency.note(answer.round_trip_s)
        if self.heard is None or answer.tag >= self.heard.answer.tag:
            self.heard = Heard(answer, monotonic_s())
        if not answer.report.is_driven and self.state == "driving":
            self.end(
                f"{self.robot} lets itself be driven no more: it was told to surface, heard no"
                " stick for long, or its battery is at the reserve."
            )
        self.changed.set()


class Drives:
    """Every drive of the station. Belongs to one event loop."""

    def __init__(self, foundation: Foundation, fleet: Fleet, radio: DriveRadio) -> None:
        self._foundation = foundation
        self._fleet = fleet
        self._radio = radio
        self._drives: dict[str, Drive] = {}

    def view(self, robot: str) -> DriveView:
        """Return how a robot is driven now.

        Raises:
            Problem: 404 for an unknown one.
        """
        status = self._fleet.status(robot)
        drive = self._drives.get(robot)
        if drive is not None:
            return self.view_of(drive)
        reason = drive_refusal(status, self._fleet.speed)
        has_depth = self._has_depth(robot)
        return DriveView(robot, "free", "", None, reason, has_depth, 0, None, None, None, 0)

    def view_of(self, drive: Drive) -> DriveView:
        """Return how far a drive is."""
        trips, heard = drive.latency.of_late(), drive.heard
        newest = None
        if heard is not None:
            report = heard.answer.report
            acts_on = report.acts_on
            newest = RobotAnswerView(
                n=heard.answer.tag,
                age_s=monotonic_s() - heard.at_s,
                acts_on=StickView(acts_on.forward, acts_on.turn, acts_on.up),
                is_silent=report.is_silent,
                is_kept_off=report.is_kept_off,
            )
        return DriveView(
            robot=drive.robot,
            state=drive.state,
            driver=drive.driver,
            begun_at=drive.begun_at,
            reason=drive.reason,
            has_depth=self._has_depth(drive.robot),
            answers=trips.answers,
            p50_ms=trips.p50_ms,
            p95_ms=trips.p95_ms,
            newest=newest,
            dropped=drive.dropped,
        )

    async def begin(self, robot: str, by: str, *, is_script: bool = False) -> Drive:
        """Have somebody drive a robot; it listens to sticks when this returns.

        Raises:
            Problem: 404 for an unknown robot; 409 with the sentence for one that cannot be driven
                now, that refuses or does not answer.
            StoreUnavailableError: If the begin cannot be written down; the drive is ended again.
        """
        status = self._fleet.status(robot)
        refuse_recording(status, "is driven by nobody")
        refuse_unless_able(status, "drive")
        if reason := drive_refusal(status, self._fleet.speed):
            raise conflict(reason)
        try:
            client = self._radio.drive(status.record.id)
        except ServiceError as error:
            raise conflict(sentence(error)) from error
        answers = not status.record.is_foreign
        now = self._foundation.clock.now()
        drive = Drive(
            status.record.id, by, client, now, answers_sticks=answers, is_script=is_script
        )
        self._drives[robot] = drive
        self._fleet.set_driver(robot, by)
        try:
            await client.begin()
            if drive.state == "beginning":
                drive.state = "driving"
            await self._log("drive.begun", robot, f"{by} drives {robot} by hand.", by)
        except ServiceError as error:
            drive.end("")
            self._forget(drive)
            raise conflict(_refusal(robot, error)) from error
        except BaseException as error:
            has_left = isinstance(error, asyncio.CancelledError)
            why = f"{by} left before it began." if has_left else "It could not be written down."
            self.finishing(drive, why)
            raise
        return drive

    def finishing(self, drive: Drive, reason: str) -> asyncio.Task[None]:
        """End a drive, whoever waits for it; see ``finish``."""
        return self._foundation.background.start(
            f"end of a drive of {drive.robot}", self.finish(drive, reason)
        )

    async def finish(self, drive: Drive, reason: str) -> None:
        """End a drive: the stick in the middle, then the robot listens no more; and log it."""
        drive.end(reason)
        try:
            await drive.client.steer(CENTRE, 0)
            await drive.client.end()
        except ServiceError as error:
            note = f" ({sentence(error).rstrip('.')}; it stops by itself.)"
        else:
            note = ""
        finally:
            self._forget(drive)
        text = f"{drive.driver} drives {drive.robot} no more: {drive.reason}{note}"
        await until_stored(
            f"the end of a drive of {drive.robot}",
            lambda: self._log("drive.ended", drive.robot, text, drive.driver),
        )

    def stop(self, robot: str, reason: str) -> None:
        """End the drive of a robot from elsewhere, such as by an order; without one do nothing."""
        if (drive := self._drives.get(robot)) is not None:
            drive.end(reason)

    def take_lease(self, event: LeaseChanged) -> None:
        """Take that a robot is another's: who drove it drives it no more."""
        drive, lease = self._drives.get(event.lease.robot), event.lease
        if drive is None:
            return
        kind = "script" if drive.is_script else "person"
        holds = (lease.holder, lease.holder_kind) == (drive.driver, kind)
        if not holds and not (drive.is_script and lease.script == drive.driver):
            drive.end(f"{drive.driver} is not in charge of {drive.robot} any more.")

    def take_hold(self, event: HoldChanged) -> None:
        """Take that automation is held: no program drives a robot."""
        for drive in self._drives.values():
            if event.hold.is_held and drive.is_script:
                drive.end(event.hold.text)

    def _forget(self, drive: Drive) -> None:
        if self._drives.get(drive.robot) is drive:
            del self._drives[drive.robot]
            self._fleet.set_driver(drive.robot, "")

    def _has_depth(self, robot: str) -> bool:
        record = self._fleet.status(robot).record
        return record.is_foreign or record.site.radio_under_water

    async def _log(self, kind: str, robot: str, text: str, by: str) -> None:
        now = self._foundation.clock.now()
        await self._foundation.store.write(
            lambda session: add_event(session, now, kind, text, robot=robot, data={"by": by})
        )


def _refusal(robot: str, error: ServiceError) -> str:
    if str(error) == _CANNOT:
        return (
            f"{robot} cannot be driven now: a mission runs, it comes up, an actuator is stuck, or"
            " its battery is at the reserve."
        )
    return sentence(error)
