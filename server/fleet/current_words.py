"""What the station says of the current in which a robot reckons its position, in words."""

import math

from robot_link.report import CurrentReport
from server.fleet.view import CurrentView

DOUBT_TOLD = 1.3
"""From here on a robot's doubt of its own positions is worth an alarm."""
LIKELY_WHY = "the water moves more than was believed, or its compass is off"
"""What makes fixes lie farther off than a robot states; they alone cannot tell which it is."""


def current_view(report: CurrentReport, age_s: float) -> CurrentView:
    """Return a report as the operator sees it."""
    north_m_s, east_m_s = report.current_ne_m_s
    return CurrentView(
        north_m_s=north_m_s,
        east_m_s=east_m_s,
        std_m_s=report.current_std_m_s,
        doubt=report.doubt,
        is_doubted=report.doubt >= DOUBT_TOLD,
        dives=report.dives,
        fixes_refused=report.fixes_refused,
        text=current_text(report),
        measured_at=report.measured_at,
        received_at=report.received_at,
        age_s=age_s,
    )


def current_text(report: CurrentReport) -> str:
    """Say what a robot believes of the current, and how far it believes itself."""
    std_m_s = report.current_std_m_s
    if report.current_ne_m_s == (0.0, 0.0):
        text = f"It has learned no current; it allows for {cm_s(std_m_s)} cm/s."
    elif told := flow_text(*report.current_ne_m_s, std_m_s):
        text = f"{told}."
    else:
        text = f"None that it could tell; give or take {cm_s(std_m_s)} cm/s."
    return " ".join(filter(None, (text, doubt_text(report), refused_text(report))))


def doubt_text(report: CurrentReport) -> str:
    """Say by how much a robot doubts its positions, and why; "" where its fixes agree with it."""
    if report.doubt < DOUBT_TOLD:
        return ""
    return (
        f"Its last fixes lay farther off than it states: {LIKELY_WHY}. Position errors may "
        f"be {report.doubt:.1f} times larger than stated. Let it surface more often, or plan with "
        "the current from dives."
    )


def refused_text(report: CurrentReport) -> str:
    """Say how many fixes a robot did not believe; "" for none."""
    count = report.fixes_refused
    if not count:
        return ""
    lay = "fix lay too far off and was" if count == 1 else "fixes lay too far off and were"
    return f"{count} {lay} not believed."


def flow_text(north_m_s: float, east_m_s: float, std_m_s: float) -> str:
    """Say how fast water moves and where to; "" where that is less than its standard deviation."""
    speed_m_s = math.hypot(north_m_s, east_m_s)
    if speed_m_s <= std_m_s:
        return ""
    to_deg = math.degrees(math.atan2(east_m_s, north_m_s)) % 360.0
    return f"{cm_s(speed_m_s)} cm/s to {round(to_deg) % 360:03d}°, give or take {cm_s(std_m_s)}"


def metres(distance_m: float) -> str:
    """Return a distance with two significant digits and its unit, never with an exponent."""
    if distance_m >= 10.0:
        step = 10.0 ** (math.floor(math.log10(distance_m)) - 1)
        return f"{round(distance_m / step) * step:.0f} m"
    return f"{distance_m:.2g} m" if distance_m >= 0.005 else "0 m"


def cm_s(speed_m_s: float) -> str:
    """Return a speed in cm/s with as many digits as a current deserves, without the unit."""
    return f"{100.0 * speed_m_s:.{1 if speed_m_s < 0.1 else 0}f}"
