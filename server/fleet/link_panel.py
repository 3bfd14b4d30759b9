"""The links of a robot as an operator sees them: state, age, what each carries, in words."""

from robot_link.messages import LinkReport, LinkState
from robot_link.station.gateway.address import is_acoustic, is_cameras, is_satellite
from server.fleet.disabled_links import shared_port
from server.fleet.link_view import RobotLinkView
from server.fleet.status import RobotStatus
from server.fleet.words import carrier_title, clock_time

_DIALOGUE = ["telemetry", "plan", "command", "surface", "parameters", "files"]
_SATELLITE = ["plan", "command", "surface"]


def link_views(status: RobotStatus) -> list[RobotLinkView]:
    """Return every link of a robot, in the order in which they are registered."""
    reports = status.links
    return [
        _view(status, uri, reports.get(uri) or reports.get(_carrier(uri)))
        for uri in status.record.links
    ]


def kind_of(uri: str) -> str:
    """Return ``radio``, ``satellite``, ``acoustic`` or ``camera``."""
    if is_satellite(uri):
        return "satellite"
    if is_cameras(uri):
        return "camera"
    return "acoustic" if is_acoustic(uri) else "radio"


def _view(status: RobotStatus, uri: str, report: LinkReport | None) -> RobotLinkView:
    kind = kind_of(uri)
    is_enabled = shared_port(uri) not in status.disabled_links
    state = LinkState.NEVER_HEARD if report is None else report.state
    if not is_enabled:
        state = LinkState.DISABLED
    return RobotLinkView(
        uri=uri,
        carrier=_carrier(uri) if report is None else report.carrier,
        kind=kind,
        state=state.value,
        is_plugged=is_enabled,
        heard_at=None if report is None else report.heard_at,
        rssi_dbm=None if report is None else report.rssi_dbm,
        frames_received=0 if report is None else report.frames_received,
        frames_bad=0 if report is None else report.frames_bad,
        is_signed=(report is not None and report.is_signed) if kind == "radio" else None,
        text=_with_trouble(_text(status, kind, _carrier(uri), state, report), report),
        carries=_carries(status, kind, state) if is_enabled else [],
    )


def _with_trouble(text: str, report: LinkReport | None) -> str:
    """Add what is wrong beside the state: a clock that is off, another radio under the same id."""
    if report is None or not report.trouble:
        return text
    return f"{text} {report.trouble[0].upper()}{report.trouble[1:]}."


def _carrier(uri: str) -> str:
    return uri.partition(":")[0]


def _carries(status: RobotStatus, kind: str, state: LinkState) -> list[str]:
    """Return what takes this link as things are; a surface order takes every one."""
    if kind == "acoustic":
        return ["range"]
    if kind == "camera":
        return ["position"]
    if kind == "satellite":
        return ["surface"] if status.known_links.radio_reaches else list(_SATELLITE)
    if state in (LinkState.LIVE, LinkState.SUBMERGED) and status.known_links.radio_reaches:
        return list(_DIALOGUE)
    return ["surface"] if status.known_links.has_satellite else list(_DIALOGUE)


def _text(
    status: RobotStatus, kind: str, carrier: str, state: LinkState, report: LinkReport | None
) -> str:
    robot, title = status.record.id, carrier_title(carrier)
    if state is LinkState.DISABLED and kind == "camera":
        return f"{title} are unplugged; {robot} is neither sought nor told where it is."
    if kind == "camera":
        return f"{title} never saw {robot}." if report is None else report.words
    if state is LinkState.DISABLED:
        return f"{title} is unplugged; nothing is sent or taken until it is plugged in again."
    if kind == "acoustic" and state is LinkState.MUTE:
        return f"The port of {title} is open, but no modem answers at its end."
    if kind == "acoustic" and state is not LinkState.PORT_CLOSED:
        return "Ranges under water; carries no plans and no orders."
    if kind == "satellite":
        return _satellite_text(status, title, state)
    match state:
        case LinkState.LIVE:
            return f"{title} hears {robot} now."
        case LinkState.SUBMERGED:
            return f"{title} expects {robot} when it comes up."
        case LinkState.STALE:
            return f"{title} does not hear {robot} any more."
        case LinkState.MUTE:
            return f"The port of {title} is open, but the radio at its end does not answer."
        case LinkState.PORT_CLOSED:
            return f"The port of {title} cannot be opened; plug it in."
        case _:
            return f"{title} never heard {robot}."


def _satellite_text(status: RobotStatus, title: str, state: LinkState) -> str:
    robot, satellite = status.record.id, status.satellite
    due = None if satellite is None else satellite.next_session_at
    expected = "" if due is None else f" Its next session is expected about {clock_time(due)}."
    match state:
        case LinkState.NEVER_HEARD:
            return f"{title} never brought a word of {robot}."
        case LinkState.SUBMERGED:
            return f"{robot} dived after its last session by {title}.{expected}"
        case LinkState.LIVE:
            return f"{robot} calls by {title} regularly.{expected}"
        case _:
            return f"{robot} is overdue: it has not called by {title}.{expected}"
