"""Builds the rows of telemetry anew from the raw journal, and holds them against what is stored.

The journal is the only source: each packet is decoded as the link decodes it, at the moment at
which the station had it, and what no robot can have measured is left out as it was then.
"""

from collections.abc import Callable, Generator, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeGuard

from sqlalchemy import select
from sqlalchemy.orm import Session

from autonomy.channel import ChannelCatalogue, key_at_station
from db.current_tables import CurrentReportRow
from db.ingest import Telemetry, append_telemetry
from db.onboard_tables import ActuatorReportRow
from db.query.fleet.robots import RobotRecord, add_robot, list_robots
from db.query.mission.plans import plan_by_hash
from db.query.station.journal import JournalRange, iterate_frames
from db.sample_tables import ChannelRow, ReadingRow, SampleLog, SampleRow
from db.store import Store
from db.tables import Base, PlanReportRow, Robot, StateRow
from db.target_tables import TargetReportRow
from robot_link.channel_table import ChannelPage, TableVersion
from robot_link.mavlink.codec import STATION_COMPONENT, STATION_SYSTEM, Codec
from robot_link.mavlink.decode import Value, decoded
from robot_link.messages import (
    OnboardPlanState,
    PlanHash,
    PlanQueue,
    PlanReport,
    RawFrame,
    Sample,
    StateReport,
    SystemId,
)
from robot_link.report import (
    ActuatorReport,
    CurrentReport,
    Detection,
    Reading,
    ReceiverReport,
    RobotReport,
    SatelliteReport,
    TargetReport,
)
from robot_link.satellite.blob import TransferId
from robot_link.satellite.frame import WireError
from robot_link.satellite.record import read_mobile_originated
from robot_link.station.gateway.address import SATELLITE_CARRIERS
from server.base.channels import catalogue_in
from server.fleet.clock_fault import ClockJudge
from server.fleet.plausibility import (
    fault_of_actuators,
    fault_of_current,
    fault_of_detection,
    fault_of_reading,
    fault_of_receiver,
    fault_of_sample,
    fault_of_state,
    fault_of_target,
)
from server.satellite.content import values_of
from server.transfer.plan_row import plan_of_transfer

TABLES: tuple[type[Base], ...] = (
    StateRow,
    SampleRow,
    ReadingRow,
    PlanReportRow,
    TargetReportRow,
    CurrentReportRow,
    ActuatorReportRow,
)
"""What is built from the journal."""
_OWN_KEYS = {"robot_key", "channel_key", "log_key"}
"""Columns that mean nothing outside of their database."""
_ROWS_AT_ONCE = 5000
_NOT_KEPT = (OnboardPlanState.RECEIVING, OnboardPlanState.REFUSED, OnboardPlanState.WAITING)
"""What a robot says of an offer concerns its upload alone."""


@dataclass(frozen=True, slots=True)
class TableComparison:
    """One table as it is stored and as the journal gives it."""

    table: str
    same: int
    only_stored: int
    """Rows that the journal does not give."""
    only_replayed: int
    """Rows that the journal gives and that are not stored."""


class Replay:
    """Decodes the packets of a journal once, in order.

    Args:
        robots: Every robot by its id.
        speed: Seconds of the robots' clock per second of the wall, as it was then.
        key: Returns the key by which a robot proves its satellite messages.
        find_plan: Returns the full hash of a robot's plan by its first digits.
        find_transfer: Returns the hash of a robot's plan by the name of its transfer.
        channels: What the station knows to be measured.
    """

    def __init__(
        self,
        robots: Mapping[str, RobotRecord],
        speed: float,
        key: Callable[[str], bytes],
        find_plan: Callable[[str, str], PlanHash | None],
        find_transfer: Callable[[str, TransferId], PlanHash | None],
        channels: ChannelCatalogue,
    ) -> None:
        self._robots = robots
        self._channels = channels
        self._speed = speed
        self._key = key
        self._find_plan = find_plan
        self._find_transfer = find_transfer
        self._codec = Codec(STATION_SYSTEM, STATION_COMPONENT)
        self._clocks: dict[str, ClockJudge] = {}
        self.packets = 0
        """Packets that were read."""

    def values(self, frames: Iterable[RawFrame]) -> Generator[RobotReport]:
        """Yield what robots said in incoming packets."""
        for frame in frames:
            self.packets += 1
            robot = None if frame.robot is None else self._robots.get(frame.robot)
            if robot is None or robot.system_id is None:
                continue
            is_radio = frame.carrier not in SATELLITE_CARRIERS
            told = self._by_radio if is_radio else self._by_satellite
            for value in told(frame, robot, robot.system_id):
                if isinstance(value, ChannelPage | TableVersion):
                    continue  # what channels mean was judged as the values came
                timed = self._known(self._timed(value, is_prompt=is_radio))
                if timed is not None and self._is_believable(timed, robot, frame):
                    yield timed

    def _known(self, value: RobotReport) -> RobotReport | None:
        """Return a report with its channel's key, ``None`` of one that the catalogue lacks."""
        match value:
            case Sample():
                key = key_at_station(value.variable, self._channels)
                return None if key is None else replace(value, variable=key)
            case Reading():
                key = key_at_station(value.channel, self._channels)
                return None if key is None else replace(value, channel=key)
            case _:
                return value

    def _by_radio(
        self, frame: RawFrame, robot: RobotRecord, system: SystemId
    ) -> Generator[RobotReport]:
        for message in self._codec.unpack(frame.data).messages:
            if message.get_srcSystem() != system:
                continue
            try:
                value = decoded(message, robot.id, frame.at)
            except ValueError:
                continue
            if isinstance(value, tuple):
                yield from value
            elif _is_kept(value):
                yield value

    def _by_satellite(
        self, frame: RawFrame, robot: RobotRecord, system: SystemId
    ) -> Sequence[SatelliteReport]:
        if not frame.data:
            return ()
        try:
            content = read_mobile_originated(
                frame.data, self._key(robot.id), system, robot.id, frame.at
            )
        except WireError:
            return ()
        return values_of(
            content,
            robot.id,
            frame.arrived_at or frame.at,
            frame.at,
            lambda digits: self._find_plan(robot.id, digits),
            lambda name: self._find_transfer(robot.id, name),
        )

    def _timed(self, value: RobotReport, *, is_prompt: bool) -> RobotReport:
        judge = self._clocks.setdefault(value.robot, ClockJudge(self._speed))
        if isinstance(value, StateReport):
            judge.hear(value, is_prompt=is_prompt)
        return judge.dated(value)

    def _is_believable(self, value: RobotReport, robot: RobotRecord, frame: RawFrame) -> bool:
        match value:
            case StateReport():
                return fault_of_state(value, robot.site, frame.at, self._speed) is None
            case Sample():
                return fault_of_sample(value, robot.site, frame.at, self._speed) is None
            case Reading():
                return fault_of_reading(value, frame.at, self._speed) is None
            case TargetReport():
                return fault_of_target(value, robot.site, frame.at, self._speed) is None
            case CurrentReport():
                return fault_of_current(value, frame.at, self._speed) is None
            case ActuatorReport():
                return fault_of_actuators(value, frame.at, self._speed) is None
            case Detection():
                return fault_of_detection(value, robot.site, frame.at, self._speed) is None
            case ReceiverReport():
                return fault_of_receiver(value, frame.at, self._speed) is None
            case PlanReport() | PlanQueue():
                return True


def _is_kept(value: Value) -> TypeGuard[RobotReport]:
    if isinstance(value, PlanReport):
        return value.state not in _NOT_KEPT
    return isinstance(value, RobotReport)


def replay_into(source: Session, target: Store, speed: float, key: Callable[[str], bytes]) -> int:
    """Fill an empty database with the robots of another and what its journal says of them.

    Args:
        source: One moment of the database with the journal.
        target: The empty database.
        speed: Seconds of the robots' clock per second of the wall, as it was then.
        key: Returns the key by which a robot proves its satellite messages.

    Returns:
        Packets that were read.
    """
    robots: dict[str, RobotRecord] = {robot.id: robot for robot in list_robots(source)}
    for robot in robots.values():
        target.change(lambda session, robot=robot: add_robot(session, robot)).result()

    def find_plan(robot: str, digits: str) -> PlanHash | None:
        found = plan_by_hash(source, robot, digits)
        return None if found is None or found.sha256 is None else PlanHash(found.sha256)

    def find_transfer(robot: str, name: TransferId) -> PlanHash | None:
        return plan_of_transfer(source, robot, name, states=None)

    replay = Replay(robots, speed, key, find_plan, find_transfer, catalogue_in(source))
    batch: list[Telemetry] = []
    for value in replay.values(iterate_frames(source, JournalRange(incoming_only=True))):
        batch.append(value)
        if len(batch) == _ROWS_AT_ONCE:
            _keep(target, batch)
            batch = []
    _keep(target, batch)
    return replay.packets


def _keep(target: Store, batch: list[Telemetry]) -> None:
    target.change(lambda session: append_telemetry(session, batch)).result()


def compare(source: Session, target: Store) -> list[TableComparison]:
    """Hold the rows of robots that talk over links against those of a replay."""
    with target.read() as replayed:
        return [_compare_table(source, replayed, table) for table in TABLES]


def _compare_table(stored: Session, replayed: Session, table: type[Base]) -> TableComparison:
    here, there = _rows(stored, table), _rows(replayed, table)
    return TableComparison(
        table.__tablename__, len(here & there), len(here - there), len(there - here)
    )


def _rows(session: Session, table: type[Base]) -> set[tuple[Any, ...]]:
    columns = [column for column in table.__table__.columns if column.name not in _OWN_KEYS]
    statement = (
        select(Robot.id, *columns)
        .join(Robot, table.__table__.c.robot_key == Robot.key)
        .where(Robot.system_id.is_not(None))
    )
    if table in {SampleRow, ReadingRow}:
        channel = ChannelRow.key == table.__table__.c.channel_key
        statement = statement.join(ChannelRow, channel).add_columns(ChannelRow.name)
    if table is SampleRow:
        statement = statement.join(SampleLog, SampleLog.key == SampleRow.log_key)
        statement = statement.add_columns(SampleLog.log)
    return {tuple(map(_hashable, row)) for row in session.execute(statement)}


def _hashable(value: Any) -> Any:  # noqa: ANN401 - what a column holds
    return tuple(map(_hashable, value)) if isinstance(value, list) else value
