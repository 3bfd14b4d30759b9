"""The readable barrier filter: printed values, statuses, limits, fallbacks, and bad input."""

import math

import pytest

from autonomy.tracking.config import THESIS_TRACKING, BarrierConfig, MotionConfig, TrackingConfig
from autonomy.tracking.reference.barrier import (
    ControlStatus,
    barrier_value,
    class_k,
    control,
    limits,
    pursuit,
    wrapped,
)
from autonomy.tracking.reference.observability import determinant_rates

AHEAD, TARGET_VELOCITY = (-1.0, 0.5, 0.3, 0.2), (0.02, 0.01)
BESIDE, STILL = (-0.1, 0.5, 0.0, 0.35), (0.0, 0.0)
DEFAULT = TrackingConfig()


def with_barrier(config, **settings):
    barrier = BarrierConfig.model_validate(config.barrier.model_dump() | settings)
    return config.model_copy(update={"barrier": barrier})


def with_motion(config, **settings):
    return config.model_copy(update={"motion": MotionConfig(**settings)})


def barrier_gradient(z, det):
    _, direction = determinant_rates(z, STILL)
    return 2.0 * det * direction[0], 2.0 * det * direction[1]


@pytest.mark.parametrize(("slope", "turn_rate"), [(0.13, -0.08262551479), (1.0, -0.31521397338)])
def test_printed_step_ahead_of_a_moving_target(slope, turn_rate):
    config = with_barrier(THESIS_TRACKING, epsilon=0.0065, slope=slope)
    step = control(AHEAD, TARGET_VELOCITY, STILL, config)
    assert step.barrier == pytest.approx(0.011627307634, abs=1e-9)
    gradient = barrier_gradient(AHEAD, step.determinant_m2_s)
    assert gradient == pytest.approx((0.04349208771, 0.20820061439), abs=1e-9)
    assert step.turn_rate_rad_s == pytest.approx(turn_rate, abs=1e-9)
    assert step.acceleration_m_s2 == pytest.approx(0.01, abs=1e-12)
    assert step.status is ControlStatus.ACTIVE


def test_printed_step_beside_a_target_that_stays():
    step = control(BESIDE, STILL, STILL, with_barrier(THESIS_TRACKING, epsilon=0.0324))
    assert step.barrier == pytest.approx(-0.001775, abs=1e-12)
    gradient = barrier_gradient(BESIDE, step.determinant_m2_s)
    assert gradient == pytest.approx((-0.35 * -0.035, 0.175), abs=1e-12)
    assert step.nominal == pytest.approx((-1.86225312127, -0.015), abs=1e-9)
    assert step.turn_rate_rad_s == pytest.approx(-0.12402040816, abs=1e-9)
    assert step.acceleration_m_s2 == pytest.approx(0.01, abs=1e-12)


@pytest.mark.parametrize(
    ("angle", "same"),
    [(math.pi, math.pi), (-math.pi, math.pi), (3.5, 3.5 - 2.0 * math.pi), (-7.0, 2 * math.pi - 7)],
)
def test_headings_are_wrapped_into_one_turn(angle, same):
    assert wrapped(angle) == pytest.approx(same, abs=1e-15)


def test_pursuit_turns_towards_the_target_and_slows_when_it_lies_behind():
    config = BarrierConfig()
    assert pursuit((-5.0, 0.0, 0.0, 0.1), config) == pytest.approx((0.0, 0.475))
    starboard, _ = pursuit((0.0, -5.0, 0.0, 0.1), config)  # the target lies east
    assert starboard > 0.0
    behind = pursuit((5.0, 0.0, 0.0, 0.1), config)
    assert behind == pytest.approx((-math.pi, -0.525))


def test_pursuit_is_defined_on_top_of_the_target():
    assert pursuit((0.0, 0.0, 0.7, 0.1), BarrierConfig()) == pytest.approx((-math.pi, -0.025))


@pytest.mark.parametrize(
    ("alpha", "positive", "negative"),
    [
        ("linear", 0.5, -0.5),
        ("cubic", 0.03125, -0.03125),
        ("negative", -0.5, 0.5),
        ("zero", 0.0, 0.0),
        ("root", math.sqrt(0.25) * 2.0, -math.sqrt(0.25) * 2.0),
        ("constant", -2.0, -2.0),
    ],
)
def test_class_k_functions_are_those_of_appendix_c(alpha, positive, negative):
    config = BarrierConfig(alpha=alpha, slope=2.0)
    assert class_k(0.25, config) == pytest.approx(positive)
    assert class_k(-0.25, config) == pytest.approx(negative)


def test_both_shapes_of_the_barrier_keep_the_same_set():
    for det in (-0.3, -0.0807, -0.0806, -0.01, 0.0, 0.05, 0.0805, 0.0807, 1.0):
        values = [
            barrier_value(det, BarrierConfig(shape=shape, epsilon=0.0065))
            for shape in ("absolute", "squared")
        ]
        assert (values[0] >= 0.0) == (values[1] >= 0.0)


def test_a_nominal_command_that_keeps_the_target_observable_is_left_alone_but_for_the_limits():
    step = control((-3.0, 0.0, 1.5, 0.3), STILL, STILL, DEFAULT)
    assert step.status is ControlStatus.UNCHANGED
    assert step.turn_rate_rad_s == pytest.approx(max(step.nominal[0], -math.pi / 4))
    assert step.acceleration_m_s2 == pytest.approx(min(step.nominal[1], 0.01))


@pytest.mark.parametrize("controller", ["nominal", "mpc_none"])
def test_without_the_barrier_the_nominal_command_is_clipped_and_no_more(controller):
    step = control(AHEAD, TARGET_VELOCITY, STILL, with_barrier(DEFAULT, controller=controller))
    assert step.status is ControlStatus.UNCHANGED
    assert (step.turn_rate_rad_s, step.acceleration_m_s2) == (-math.pi / 4, 0.01)
    assert step.nominal == pursuit(AHEAD, DEFAULT.barrier)
    assert step.determinant_m2_s == pytest.approx(-0.13463769024)


def test_where_the_barrier_cannot_be_kept_the_fallback_is_as_chosen():
    inside = (0.0, 0.05, 1.4, 0.06)
    best = control(inside, STILL, STILL, DEFAULT)
    thesis = control(inside, STILL, STILL, with_barrier(DEFAULT, fallback="nominal"))
    assert best.status is thesis.status is ControlStatus.INFEASIBLE
    drift, direction = determinant_rates(inside, STILL)
    sign = math.copysign(1.0, best.determinant_m2_s)

    def rise(step):
        rate = direction[0] * step.turn_rate_rad_s + direction[1] * step.acceleration_m_s2
        return sign * (drift + rate)

    assert rise(best) > rise(thesis)
    assert abs(best.turn_rate_rad_s) == pytest.approx(math.pi / 4)
    clipped = tuple(
        min(max(value, low), high)
        for value, low, high in zip(thesis.nominal, *limits(inside[3], DEFAULT.motion), strict=True)
    )
    assert (thesis.turn_rate_rad_s, thesis.acceleration_m_s2) == clipped


@pytest.mark.parametrize("shape", ["absolute", "squared"])
def test_best_effort_leaves_the_line_of_sight_with_either_shape(shape):
    collinear = (-2.0, 0.0, 0.0, 0.2)
    step = control(collinear, STILL, STILL, with_barrier(DEFAULT, shape=shape, slope=1.0))
    assert step.determinant_m2_s == 0.0
    assert step.status is not ControlStatus.UNCHANGED
    assert abs(step.turn_rate_rad_s) > 0.1


@pytest.mark.parametrize("acceleration", [(0.0, 0.0), (0.003, 0.0), (-0.003, 0.001)])
def test_an_active_step_lets_the_barrier_fall_as_fast_as_allowed_with_a_known_acceleration(
    acceleration,
):
    config = with_barrier(DEFAULT, epsilon=0.0324)
    step = control(BESIDE, STILL, acceleration, config)
    assert step.status is ControlStatus.ACTIVE
    drift, direction = determinant_rates(BESIDE, acceleration)
    rate = direction[0] * step.turn_rate_rad_s + direction[1] * step.acceleration_m_s2
    growth = math.copysign(1.0, step.determinant_m2_s) * (drift + rate)
    assert growth == pytest.approx(-class_k(step.barrier, config.barrier), abs=1e-12)


def test_the_speed_is_held_between_floor_and_cap():
    motion = MotionConfig(speed_min_m_s=0.1, speed_max_m_s=0.3)
    assert limits(0.2, motion)[0][1] == -0.01
    assert limits(0.2, motion)[1][1] == 0.01
    assert limits(0.299, motion)[1][1] == pytest.approx(0.001)
    assert limits(0.5, motion)[1][1] == -0.01
    assert limits(0.101, motion)[0][1] == pytest.approx(-0.001)
    assert limits(0.0, motion)[0][1] == 0.01
    far = with_motion(DEFAULT, speed_min_m_s=0.1, speed_max_m_s=0.3)
    assert control((-9.0, 0.0, 1.0, 0.31), STILL, STILL, far).acceleration_m_s2 < 0.0
    assert control((9.0, 0.0, 1.0, 0.05), STILL, STILL, far).acceleration_m_s2 == 0.01


def test_a_robot_that_cannot_brake_is_never_asked_to():
    motion = with_motion(DEFAULT, acceleration_min_m_s2=0.0)
    step = control((5.0, 0.1, 0.0, 0.4), STILL, STILL, motion)
    assert step.acceleration_m_s2 >= 0.0
    assert control((5.0, 0.1, 0.0, 0.9), STILL, STILL, motion).acceleration_m_s2 == 0.0


def test_a_floor_above_the_cap_is_refused_by_name():
    with pytest.raises(ValueError, match="speed_min_m_s must be below speed_max_m_s"):
        MotionConfig(speed_min_m_s=0.7)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 1e12])
@pytest.mark.parametrize("place", range(8))
def test_bad_input_commands_nothing_and_says_so(place, value):
    numbers = [-1.0, 0.5, 0.3, 0.2, 0.02, 0.01, 0.0, 0.0]
    numbers[place] = value
    step = control(numbers[:4], numbers[4:6], numbers[6:], DEFAULT)
    assert step.status is ControlStatus.BAD_INPUT
    assert (step.turn_rate_rad_s, step.acceleration_m_s2, step.nominal) == (0.0, 0.0, (0.0, 0.0))
    assert (step.determinant_m2_s, step.barrier) == (0.0, 0.0)
