"""What the station says of how a robot's actuators follow, in words."""

from autonomy.vehicle.config import Vehicle
from robot_link.report import ActuatorFollowing, ActuatorReport
from server.fleet.view import ActuatorFollowingView, ActuatorsView

_LEAST_SHARE, _LEAST_DELAY_S = 0.005, 0.05
"""Of a rate and of a delay, s, that are told; less is rounding."""


def actuators_view(report: ActuatorReport, vehicle: Vehicle | None, age_s: float) -> ActuatorsView:
    """Return a report as the operator sees it.

    Args:
        report: What the robot said.
        vehicle: Its model, which knows the nominal rates; None for an unknown one.
        age_s: Age of the report.
    """
    return ActuatorsView(
        mass=_following(report.mass, age_s),
        pump=_following(report.pump, age_s),
        speed_share=report.speed_share,
        is_mass_off=report.is_mass_off,
        is_swinging=report.is_swinging,
        stuck=list(report.stuck),
        text=actuators_text(report, vehicle),
        measured_at=report.measured_at,
        received_at=report.received_at,
        age_s=age_s,
    )


def actuators_text(report: ActuatorReport, vehicle: Vehicle | None = None) -> str:
    """Say how the actuators follow, and what the robot makes of it."""
    trouble = trouble_text(report)
    if trouble and not report.is_mass_off:
        return trouble
    return " ".join(filter(None, (_mass_text(report.mass, vehicle), slowed_text(report), trouble)))


def slowed_text(report: ActuatorReport) -> str:
    """Say how far the legs are slowed; "" where they are flown as planned."""
    if report.speed_share > 0.99:
        return ""
    share = f"{report.speed_share:.0%}"
    return f"Dives are flown at {share} of their planned speed, so that it can follow."


def trouble_text(report: ActuatorReport) -> str:
    """Say what is wrong with the actuators beyond slowness; "" for nothing."""
    if report.stuck:
        names = " and ".join(report.stuck)
        are = "is" if len(report.stuck) == 1 else "are"
        return f"The {names} {are} stuck: told to move and stood still."
    if report.is_swinging:
        return "Pitch and sliding mass swing; the robot flies its gentlest gait."
    return ""


def _mass_text(mass: ActuatorFollowing, vehicle: Vehicle | None) -> str:
    told: list[str] = []
    if abs(mass.rate_share - 1.0) >= _LEAST_SHARE:
        told.append(f"moves {_rate_text(mass.rate_share, vehicle)}")
    if mass.delay_s >= _LEAST_DELAY_S:
        told.append(f"answers {mass.delay_s:.1f} s late")
    if told:
        return f"The sliding mass {' and '.join(told)}."
    if mass.learned_age_s is None:
        return "Nothing was learned of the sliding mass yet."
    return "The sliding mass follows its commands as the model says."


def _rate_text(share: float, vehicle: Vehicle | None) -> str:
    if vehicle is None:
        return f"at {share:.0%} of its nominal rate"
    nominal = vehicle.limits.rp1_rate_m_s * 1e3
    return f"at {nominal * share:.1f} mm/s ({nominal:.1f} nominal)"


def _following(following: ActuatorFollowing, age_s: float) -> ActuatorFollowingView:
    learned = following.learned_age_s
    return ActuatorFollowingView(
        rate_share=following.rate_share,
        delay_s=following.delay_s,
        learned_age_s=None if learned is None else learned + age_s,
    )
