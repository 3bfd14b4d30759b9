"""What the robot believes on board, by either method, and what a bad sensor does to it."""

import math
from dataclasses import fields, replace

import numpy as np
import pytest

from autonomy.estimation.config import EstimatorConfig
from autonomy.frames import convergence_rad
from autonomy.site import LAKE, TANK, Box
from onboard.flight.hardware import Readings, SetPoints
from onboard.flight.navigation import Navigator
from simulator.fleet import MINI_1, RobotDefinition
from tests.simulator.flight import Life, mission, two_dives

REST = Readings(0.0, 0.0, 0.0, 0.0, (0.0, 0.0, 0.0), 0.0, 0.0, 0.0, 1.0, 10.0, (1.0, 0.5))
STEADY_M_S = 0.01
METHODS = pytest.mark.parametrize("method", ["position", "model"])


class Unaware(RobotDefinition):
    """The Miniglider with the filter on board that learns no current."""

    @property
    def estimator(self) -> EstimatorConfig:
        return super().estimator.model_copy(update={"method": "position"})


def in_steady_current(kind: type[RobotDefinition]) -> RobotDefinition:
    """Return a Miniglider in a current that outlasts the flight."""
    lasting_s = 1e6
    values = {field.name: getattr(MINI_1, field.name) for field in fields(MINI_1)}
    values["current_correlation_s"] = lasting_s
    values["drift_m_sqrt_s"] = STEADY_M_S * math.sqrt(2.0 * lasting_s)
    return kind(**values)


def surfacing_errors(definition: RobotDefinition, seed: int) -> list[float]:
    life = Life(definition, seed)
    life.live(20.0)  # a look at the current before the first dive
    track = life.fly(mission(*two_dives()))
    assert np.isfinite(track).all()
    is_under = track[:, 7] > 0.05
    at = np.flatnonzero(is_under[:-1] & ~is_under[1:])
    return [math.hypot(track[k, 1] - track[k, 5], track[k, 2] - track[k, 6]) for k in at]


def test_a_robot_that_learns_the_current_surfaces_where_it_believes() -> None:
    seeds = range(2)
    unaware = [e for s in seeds for e in surfacing_errors(in_steady_current(Unaware), s)]
    learned = [e for s in seeds for e in surfacing_errors(in_steady_current(RobotDefinition), s)]
    assert len(unaware) >= 4
    assert len(learned) >= 4
    assert np.mean(np.square(learned)) < 0.25 * np.mean(np.square(unaware))


def navigator(method: str) -> Navigator:
    config = EstimatorConfig.model_validate({"method": method})
    return Navigator(config, MINI_1.vehicle, TANK, REST, 0.1)


@METHODS
def test_a_flight_goes_on_with_the_last_good_number_of_a_sensor(method: str) -> None:
    there = navigator(method)
    bad = replace(
        REST,
        depth_m=math.nan,
        heading_rad=math.inf,
        gyro_rad_s=(0.0, math.nan, 0.0),
        net_buoyancy_kg=math.nan,
        battery_v=math.nan,
        fix_ne_m=(math.nan, 0.5),
    )
    for k in range(20):
        estimate = there.step(REST if k % 2 else bad, SetPoints(0.0, 0.0), 0.1 * k)
        assert np.isfinite([*estimate.state, estimate.position_std_m]).all()
        assert estimate.readings.battery_v == REST.battery_v
        assert estimate.readings.fix_ne_m in (None, REST.fix_ne_m)
    assert estimate.position_ned[:2] == pytest.approx((1.0, 0.5), abs=0.05)


@METHODS
def test_a_receiver_that_repeats_itself_gives_no_fixes(method: str) -> None:
    stuck, blind = navigator(method), navigator(method)
    for k in range(60):
        a = stuck.step(REST, SetPoints(0.0, 0.0), 0.1 * k)
        b = blind.step(
            REST if k == 0 else replace(REST, fix_ne_m=None), SetPoints(0.0, 0.0), 0.1 * k
        )
    assert not a.has_fix
    assert a.position_std_m == b.position_std_m
    assert a.position_ned == b.position_ned


def test_navigation_does_not_begin_with_nonsense() -> None:
    with pytest.raises(ValueError, match="finite"):
        Navigator(EstimatorConfig(), MINI_1.vehicle, TANK, replace(REST, depth_m=math.nan), 0.1)


def test_a_heading_far_from_the_origin_counts_from_the_north_of_the_frame() -> None:
    east_m = 50_000.0
    wide = LAKE.model_copy(update={"water": Box(x_max_m=1e3, y_max_m=6e4, depth_max_m=20.0)})
    at = replace(REST, heading_rad=1.0, fix_ne_m=(0.0, east_m))
    navigator = Navigator(EstimatorConfig(), MINI_1.vehicle, wide, at, 0.1)
    lead_rad = float(convergence_rad([0.0, east_m], LAKE.origin_latitude_deg))
    assert math.degrees(lead_rad) == pytest.approx(0.416, abs=0.002)
    estimate = navigator.step(at, SetPoints(0.0, 0.0), 0.0)
    assert estimate.heading_rad == pytest.approx(1.0 - lead_rad, abs=math.radians(0.01))
