"""Missions, keys and strategies that the tests of satellite messages share."""

import math
from dataclasses import replace
from datetime import UTC, datetime

from hypothesis import strategies as st

from autonomy.control.config import BACKSTEPPING_PRESETS
from autonomy.field.config import FIELD_PRESETS
from autonomy.planner.plan import Leg, PrimitiveKind
from autonomy.planner.preset import PLANNER_PRESETS
from benchmarks.link.satellite_mission import usual_mission
from robot_link.messages import (
    LogId,
    RobotId,
    RobotMode,
    Sample,
    StateReport,
    SystemId,
)
from robot_link.mission import Mission, MissionSettings
from robot_link.onboard_settings import OnboardSettings
from robot_link.surfacing_order import SurfacingOrder, ValueLimit

KEY = bytes(range(32))
OTHER_KEY = bytes(range(1, 33))
SYSTEM, OTHER_SYSTEM = SystemId(7), SystemId(8)
ROBOT = RobotId("lake-1")
NOW = datetime(2026, 6, 1, 12, 0, tzinfo=UTC)
ONBOARD = OnboardSettings.of(
    "controller.backstepping",
    BACKSTEPPING_PRESETS["grace3"],
    PLANNER_PRESETS["grace3"],
    FIELD_PRESETS["chlorophyll"],
)
SURVEY = usual_mission(0)
"""Twenty items in two chunks."""


def short_mission(depth_m: float = 5.0, *, onboard: OnboardSettings | None = ONBOARD) -> Mission:
    """Return a mission of one chunk; another depth makes another mission."""
    bottom = (10.0, 0.0, depth_m)
    legs = (
        Leg(PrimitiveKind.GLIDE, (0.0, 0.0, 0.0), bottom, 0.06, depth_m / 0.06, 1.9, 0.0),
        Leg(PrimitiveKind.GLIDE, bottom, (20.0, 0.0, 0.0), 0.06, depth_m / 0.06, 1.9, 0.0),
    )
    settings = MissionSettings(10.0, 12.0, 3600.0, 0.0, 0.0)
    return Mission.from_legs(settings, legs, onboard=onboard)


_coordinates = st.floats(-16_000.0, 16_000.0)
_depths = st.one_of(st.just(0.0), st.floats(0.0, 200.0))


@st.composite
def missions(draw: st.DrawFn) -> Mission:
    """Any mission that can travel at all, sensible or not."""
    version = draw(st.sampled_from((1, 2, 3, 5)))
    trim = (draw(st.floats(-0.5, 0.5)), draw(st.floats(-0.05, 0.05))) if version > 1 else (0, 0)
    start = (draw(_coordinates), draw(_coordinates), 0.0)
    settings = MissionSettings(
        draw(st.floats(0.1, 600.0)), draw(st.floats(0.01, 99.0)), 3600.0, *start[:2], *trim
    )
    legs: list[Leg] = []
    for _ in range(draw(st.integers(0, 8))):
        kind = draw(st.sampled_from(PrimitiveKind))
        end = (draw(_coordinates), draw(_coordinates), draw(_depths))
        may_jump = bool(legs) and kind is not PrimitiveKind.SPIRAL and start[2] == 0.0
        if may_jump and draw(st.booleans()):
            start = (start[0] + draw(st.floats(-90, 90)), start[1] + draw(st.floats(-90, 90)), 0.0)
        circle = {}
        if kind is PrimitiveKind.SPIRAL:
            circle = {"radius_m": draw(st.floats(0.1, 9.0)), "turn_rad": draw(st.floats(-40, 40))}
        elif kind is PrimitiveKind.KEEP:
            circle = {"radius_m": draw(st.floats(0.0, 900.0))}
        leg = Leg(
            kind,
            start,
            end,
            draw(st.sampled_from((0.0, 0.06, 1.5))),
            draw(st.floats(0.0, 90_000.0)),
            draw(st.floats(0.0, 900.0)),
            draw(st.floats(-math.pi, math.pi)),
            **circle,
        )
        legs.append(leg)
        start = end
    onboard = ONBOARD if version == 3 or (version == 5 and draw(st.booleans())) else None
    rules = draw(surfacing_orders()) if version == 5 else None
    return Mission.from_legs(settings, tuple(legs), version, onboard=onboard, rules=rules)


@st.composite
def surfacing_orders(draw: st.DrawFn) -> SurfacingOrder:
    """Any rules of surfacing that can travel."""
    values = st.floats(-1e30, 1e30).filter(lambda one: one == 0.0 or abs(one) > 1e-20)
    limit = st.builds(ValueLimit, st.integers(1, 255), st.booleans(), values)
    return SurfacingOrder.of(
        draw(st.none() | st.integers(1, 1_000_000)),
        draw(st.integers(0, 86_400)),
        draw(st.lists(limit, max_size=4)),
    )


def state(**changes: object) -> StateReport:
    """Return a robot's state at the surface of the lake."""
    value = StateReport(
        robot=ROBOT,
        measured_at=NOW,
        received_at=NOW,
        position_ned=(123.456, -98.765, 0.12),
        position_std_m=3.21,
        velocity_ned=(0.05, -0.1, 0.02),
        roll_rad=0.02,
        pitch_rad=-0.3,
        heading_rad=1.5,
        net_buoyancy_kg=-0.045,
        mass_position_m=0.0123,
        tail_rad=0.1,
        battery_fraction=0.8,
        battery_v=14.8,
        mode=RobotMode.SURFACED,
        has_fix=True,
        energy_used=0.0,
    )
    return replace(value, **changes)


def sample(sequence: int, **changes: object) -> Sample:
    """Return a sample of the lake."""
    value = Sample(
        robot=ROBOT,
        log=LogId(3),
        sequence=sequence,
        variable="chlorophyll",
        value=4.5 + 0.01 * sequence,
        position_ned=(100.0 + sequence, 50.0 - 0.5 * sequence, 4.0),
        position_std_m=2.5,
        measured_at=NOW,
        received_at=NOW,
    )
    return replace(value, **changes)
