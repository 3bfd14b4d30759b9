"""Which tables of channels robots announced, and from which measurement on each held."""

from sqlalchemy import func, literal, select, tuple_
from sqlalchemy.orm import Session

from db.onboard_tables import RobotChannelRow
from db.query.fleet.robots import robot_key
from db.query.measured.samples import channel_key
from db.sample_ingest import upsert
from db.sample_tables import SampleLog, SampleRow
from db.tables import Robot
from robot_link.channel_table import Announcement, ChannelTable, TableRow
from robot_link.messages import LogId, RobotId
from robot_link.sample_log import SampleKey


def keep_announcement(session: Session, announced: Announcement) -> None:
    """Keep a table; one that held from the same measurement on is replaced.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    table = announced.table
    rows = [[row.number, row.key, row.unit, row.kind, row.period_s] for row in table.rows]
    kept = {
        "version": table.version,
        "since_at": announced.since_at,
        "heard_at": announced.heard_at,
        "document": {"rows": rows},
    }
    named = {
        "robot_key": robot_key(session, announced.robot),
        "log": announced.since.log,
        "sequence": announced.since.sequence,
    }
    statement = upsert(session, RobotChannelRow).values(**named, **kept)
    session.execute(statement.on_conflict_do_update(index_elements=list(named), set_=kept))


def stored_since(session: Session, announced: Announcement, channel: str) -> int:
    """Return how many samples of a channel are stored that were measured under a table.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    is_under = tuple_(SampleLog.log, SampleRow.sequence) >= tuple_(
        literal(announced.since.log), literal(announced.since.sequence)
    )
    counted = (
        select(func.count())
        .select_from(SampleRow)
        .join(SampleLog, SampleLog.key == SampleRow.log_key)
        .where(
            SampleRow.robot_key == robot_key(session, announced.robot),
            SampleRow.channel_key == channel_key(channel),
            is_under,
        )
    )
    return session.scalars(counted).one()


def list_announcements(session: Session) -> list[Announcement]:
    """Return every table of every robot, those of one robot in the order in which they held."""
    found = session.execute(
        select(Robot.id, RobotChannelRow)
        .join(Robot, Robot.key == RobotChannelRow.robot_key)
        .order_by(RobotChannelRow.robot_key, RobotChannelRow.log, RobotChannelRow.sequence)
    )
    return [
        Announcement(
            RobotId(robot),
            ChannelTable(tuple(TableRow(*one) for one in row.document["rows"])),
            SampleKey(LogId(row.log), row.sequence),
            row.since_at,
            row.heard_at,
        )
        for robot, row in found
    ]
