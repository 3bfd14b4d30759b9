"""Pages of a robot's table of channels between GRACE_CHANNELS and the project's values."""

from datetime import datetime

from robot_link.channel_table import ChannelPage, ChannelTable, pages, rows_of
from robot_link.mavlink.telemetry import microseconds, moment
from robot_link.mavlink.wire import grace
from robot_link.messages import LogId, RobotId
from robot_link.sample_log import SampleKey

_OCTETS = 200
_HEAD_BYTES = 12 + grace.MAVLink_grace_channels_message.unpacker.size - _OCTETS
"""Bytes of a frame beside the rows."""


def page_messages(
    table: ChannelTable, since: SampleKey, since_at: datetime, payload_bytes: int
) -> list[grace.MAVLink_grace_channels_message]:
    """Return all pages of a table, each in a frame of at most ``payload_bytes``.

    Args:
        table: What is announced.
        since: The first measurement for which it holds.
        since_at: When it came into force.
        payload_bytes: What one packet of the radio carries.

    Raises:
        ValueError: If a packet has no room for a row.
    """
    room = min(_OCTETS, payload_bytes - _HEAD_BYTES)
    cut = pages(table, room, is_short=False)
    return [
        grace.MAVLink_grace_channels_message(
            since_utc_us=microseconds(since_at),
            version=table.version,
            log=since.log,
            sequence=since.sequence,
            page=number,
            pages=len(cut),
            length=len(octets),
            rows=octets.ljust(_OCTETS, b"\0"),
        )
        for number, octets in enumerate(cut)
    ]


def channel_page(
    message: grace.MAVLink_grace_channels_message, robot: RobotId, received_at: datetime
) -> ChannelPage:
    """Decode a page.

    Raises:
        ValueError: If it says what cannot be.
    """
    if not message.page < message.pages or message.length > _OCTETS or not message.version:
        raise ValueError("a page of a table of channels cannot be this one")
    return ChannelPage(
        robot=robot,
        version=message.version,
        log=LogId(message.log),
        sequence=message.sequence,
        page=message.page,
        pages=message.pages,
        rows=rows_of(bytes(message.rows[: message.length])),
        is_short=False,
        measured_at=moment(message.since_utc_us),
        received_at=received_at,
    )
