"""The depth sensor's zero: taken at the surface alone, kept, and refused where it cannot be it."""

from dataclasses import replace

import pytest

from onboard.flight.depth_zero import ABOVE_MAX_M, OFFSET_MAX_M, DepthZero
from onboard.flight.hardware import Readings

AT_REST = Readings(
    depth_m=0.0,
    roll_rad=0.0,
    pitch_rad=0.0,
    heading_rad=0.0,
    gyro_rad_s=(0.0, 0.0, 0.0),
    net_buoyancy_kg=0.0,
    mass_position_m=0.0,
    tail_rad=0.0,
    battery_fraction=1.0,
    battery_v=12.0,
    fix_ne_m=None,
)


def hear(zero, *depths_m):
    for depth_m in depths_m:
        told = zero.corrected(replace(AT_REST, depth_m=depth_m))
    return told.depth_m


def test_what_the_sensor_reads_at_the_surface_is_taken_off_every_depth():
    zero = DepthZero()
    assert hear(zero, *[0.21, 0.19] * 5) == pytest.approx(0.19)
    assert zero.offset_m is None
    assert zero.take()
    assert zero.offset_m == pytest.approx(0.20)
    assert hear(zero, 1.20) == pytest.approx(1.00)
    hear(zero, *[0.21, 0.19] * 5)
    assert zero.take()
    assert zero.offset_m == pytest.approx(0.20), "of what the sensor says, not of what is left"


@pytest.mark.parametrize("depth_m", [-ABOVE_MAX_M - 0.02, OFFSET_MAX_M + 0.02, 1.1])
def test_reading_that_cannot_be_the_surface_changes_nothing(depth_m):
    zero = DepthZero()
    hear(zero, *[depth_m] * 10)
    assert zero.is_steady
    assert not zero.take()
    assert zero.offset_m is None


def test_robot_that_moves_up_or_down_is_not_steady():
    zero = DepthZero()
    hear(zero, *[0.1] * 9)
    assert not zero.is_steady, "not a second yet"
    hear(zero, 0.1)
    assert zero.is_steady
    hear(zero, 0.2)
    assert not zero.is_steady


def test_zero_outlives_the_switch_and_a_kept_one_that_is_none_is_left_out():
    kept: dict[str, float] = {}
    zero = DepthZero()
    zero.restore({}, kept.update)
    hear(zero, *[0.12] * 10)
    assert zero.take()
    again = DepthZero()
    again.restore(kept, kept.update)
    assert hear(again, 0.12) == pytest.approx(0.0)
    for bad in ({"offset_m": 7.0}, {"offset_m": float("nan")}, {"other": 0.1}):
        other = DepthZero()
        other.restore(bad, kept.update)
        assert other.offset_m is None
