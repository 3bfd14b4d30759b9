"""When a robot was heard by satellite, and when it will speak next."""

from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Final

from robot_link.messages import LinkReport, LinkState
from robot_link.satellite.config import SatelliteConfig
from server.fleet.status import UNDER_WATER, RobotStatus
from server.satellite.modem import Modem

_MISSED: Final = 2
"""Sessions that may fail before a robot counts as overdue: the next word is due after two."""


@dataclass(frozen=True, slots=True)
class Heard:
    """What a modem brought."""

    session_at: datetime | None
    """Of its newest session that brought a word of the robot, by the satellite network's clock."""
    frames_received: int
    frames_bad: int


def next_session_at(status: RobotStatus, heard: Heard | None, period_s: float) -> datetime | None:
    """Return when a robot is expected to call next.

    One that dived, or dives before its next session, calls when it comes up; one that radio
    reaches does not call at all.
    """
    if heard is None or heard.session_at is None or status.radio_state is LinkState.LIVE:
        return None
    calls_at, dives_at = heard.session_at + timedelta(seconds=period_s), status.dives_at()
    if _has_dived(status) or (dives_at is not None and dives_at < calls_at):
        return status.next_surfacing()
    return calls_at


def link_report(
    modem: Modem,
    status: RobotStatus,
    heard: Heard | None,
    config: SatelliteConfig,
    now: datetime,
    *,
    is_enabled: bool,
) -> LinkReport:
    """Return the health of a satellite link, from the robot's last session."""
    return LinkReport(
        robot=modem.robot,
        carrier=modem.carrier,
        state=_state(status, heard, config, now) if is_enabled else LinkState.DISABLED,
        heard_at=None if heard is None else heard.session_at,
        rssi_dbm=None,
        frames_received=0 if heard is None else heard.frames_received,
        frames_bad=0 if heard is None else heard.frames_bad,
        uri=modem.uri,
        is_enabled=is_enabled,
        radio=modem.imei,
    )


def is_out_of_contact(status: RobotStatus, config: SatelliteConfig, now: datetime) -> bool:
    """Tell whether a robot was not heard on any link for so long that nothing is sent."""
    lost_at = contact_lost_at(status, config)
    return lost_at is None or now >= lost_at


def contact_lost_at(status: RobotStatus, config: SatelliteConfig) -> datetime | None:
    """Return when a robot is out of contact if it stays silent, ``None`` if it never was in it."""
    heard_at = status.heard_at
    return None if heard_at is None else heard_at + timedelta(hours=config.contact_expiry_h)


def out_of_contact_text(status: RobotStatus, config: SatelliteConfig) -> str:
    """Say why nothing is sent to a robot that is out of contact."""
    robot, heard_at = status.record.id, status.heard_at
    if heard_at is None:
        return f"{robot} was never heard on any link."
    return (
        f"{robot} was last heard at {heard_at:%Y-%m-%d %H:%MZ}, more than "
        f"{config.contact_expiry_h:g} h ago."
    )


def _state(
    status: RobotStatus, heard: Heard | None, config: SatelliteConfig, now: datetime
) -> LinkState:
    overdue = None if heard is None else overdue_at(heard, config)
    if overdue is None:
        return LinkState.NEVER_HEARD
    if _has_dived(status):
        return LinkState.SUBMERGED
    return LinkState.LIVE if now < overdue else LinkState.STALE


def overdue_at(heard: Heard, config: SatelliteConfig) -> datetime | None:
    """Return when a robot at the surface counts as overdue if it does not call before.

    ``None`` for one that was never heard.
    """
    if heard.session_at is None:
        return None
    return heard.session_at + timedelta(seconds=_MISSED * config.session_period_s)


def _has_dived(status: RobotStatus) -> bool:
    is_under = status.state is not None and status.state.mode in UNDER_WATER
    return is_under or status.follows_under_water
