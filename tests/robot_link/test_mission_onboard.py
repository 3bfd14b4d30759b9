"""Missions of format 3: what they bring on board is the same by every road, and old ones stay."""

import struct

import cbor2
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from autonomy.control.catalogue import CONTROLLERS
from autonomy.control.config import BacksteppingConfig
from autonomy.control.integral_config import IntegralConfig
from autonomy.field.config import FIELD_PRESETS
from autonomy.planner.config import PlannerConfig
from autonomy.planner.preset import PLANNER_PRESETS
from robot_link.mavlink.mission_item import item_count, mission_from_items, mission_items
from robot_link.messages import SystemId
from robot_link.mission import Mission
from robot_link.onboard_settings import OnboardSettings
from robot_link.short_decimal import code_of, value_of
from tests.robot_link.satellite_case import ONBOARD, SURVEY, missions, short_mission

PLANNER, FIELD = PLANNER_PRESETS["grace3"], FIELD_PRESETS["chlorophyll"]


@pytest.mark.parametrize("kind", CONTROLLERS)
@pytest.mark.parametrize("vehicle", ["miniglider", "grace3"])
def test_every_controller_arrives_with_gains_within_an_eighth_of_a_percent(kind, vehicle):
    gains = CONTROLLERS[kind].preset(vehicle)
    onboard = OnboardSettings.of(kind, gains, PLANNER, FIELD)
    assert onboard.controller_kind == kind
    arrived = onboard.controller_config()
    assert type(arrived) is type(gains)
    for name, value in gains.model_dump().items():
        expected = value if isinstance(value, str) else pytest.approx(value, rel=1.3e-3)
        assert getattr(arrived, name) == expected, name
    assert CONTROLLERS[kind].packed(arrived).shape == CONTROLLERS[kind].packed(gains).shape


def test_prices_and_digest_arrive_as_the_planner_and_the_map_have_them():
    assert ONBOARD.energy_config() == PLANNER.energy
    digest = ONBOARD.digest_settings()
    assert digest.thresholds_m == PLANNER.fidelity_thresholds_m
    assert digest.kernel.length_scales_m() == FIELD.single.length_scales_m()
    assert digest.kernel.shape == FIELD.single.shape
    worst, middle, best = digest.level_noise_variances
    assert worst > middle > best > FIELD.single.noise_variance


@pytest.mark.parametrize("model", ["single", "recursive", "joint"])
def test_levels_of_other_models_bring_their_own_noise(model):
    field = FIELD.model_copy(update={"model": model})
    onboard = OnboardSettings.of(
        "controller.backstepping", BacksteppingConfig(), PlannerConfig(), field
    )
    kernels = {
        "single": (field.single,) * 3,
        "recursive": field.levels,
        "joint": field.joint_levels,
    }
    expected = [pytest.approx(one.noise_variance, rel=1.3e-3) for one in kernels[model]]
    assert list(onboard.digest_settings().level_noise_variances) == expected


def test_what_was_rounded_once_is_not_rounded_again():
    rounded = ONBOARD.controller_config()
    again = OnboardSettings.of(ONBOARD.controller_kind, rounded, PLANNER, FIELD)
    assert again == ONBOARD


def test_gain_at_its_limit_does_not_round_beyond_it():
    gains = IntegralConfig(k_z=0.08004, k_1=0.9, k_depth_integral=0.07203)
    onboard = OnboardSettings.of("controller.integral", gains, PLANNER, FIELD)
    arrived = onboard.controller_config()
    assert isinstance(arrived, IntegralConfig)
    assert arrived.k_depth_integral < arrived.k_z * arrived.k_1


def test_gain_that_cannot_travel_is_named():
    with pytest.raises(ValueError, match=r"k_z: 1e-12 cannot travel"):
        OnboardSettings.of("controller.baseline", BacksteppingConfig(k_z=1e-12), PLANNER, FIELD)
    with pytest.raises(ValueError, match="these gains are BacksteppingConfig, not PidConfig"):
        OnboardSettings.of("controller.pid", BacksteppingConfig(), PLANNER, FIELD)


@given(st.lists(st.integers(-(2**24), 2**24), max_size=70))
def test_any_integers_are_settings_or_a_sentence(integers):
    try:
        found = OnboardSettings.from_integers(integers)
    except ValueError:
        return
    assert found.integers() == tuple(integers)[: len(found.integers())]


@given(st.integers(0, 60), st.integers(-(2**20), 2**20))
def test_one_wrong_integer_among_the_settings_never_breaks_the_reader(index, number):
    integers = list(ONBOARD.integers())
    integers[index % len(integers)] = number
    try:
        found = OnboardSettings.from_integers(integers)
    except ValueError:
        return
    found.controller_config()
    found.energy_config()
    found.digest_settings()


@given(st.floats(1e-9, 4e8) | st.floats(-4e8, -1e-9))
def test_short_decimal_is_close_exact_in_float32_and_stays(value):
    code = code_of(value)
    tolerance = {"rel": 1.3e-3, "abs": 5.1e-11}
    assert value_of(code) == pytest.approx(value, **tolerance)
    assert struct.unpack("<f", struct.pack("<f", code))[0] == code
    assert value_of(code_of(value_of(code))) == value_of(code)
    assert abs(value_of(code_of(value, toward_zero=True))) <= abs(value)


@pytest.mark.parametrize("value", [float("nan"), float("inf"), 1e-11, 5e8])
def test_short_decimal_refuses_what_it_cannot_say(value):
    with pytest.raises(ValueError, match="cannot travel"):
        code_of(value)


@settings(deadline=None)
@given(missions())
def test_mission_of_any_format_is_the_same_by_radio(mission):
    carried = mission_from_items(mission_items(mission, SystemId(1)))
    assert (carried, carried.sha256()) == (mission, mission.sha256())


def test_tuning_travels_as_whole_numbers_behind_the_trim():
    items = mission_items(SURVEY, SystemId(1))
    names = [item.command for item in items[:7]]
    assert names == [54000, 54006, *[54007] * 5]
    assert item_count(SURVEY) == len(items)
    for item in items[2:7]:
        numbers = (item.param1, item.param2, item.param3, item.param4)
        assert all(struct.unpack("<f", struct.pack("<f", one))[0] == one for one in numbers)
    with pytest.raises(ValueError, match="item 3 with command 54007 does not belong there"):
        mission_from_items((*items[:2], items[7], items[2]))


def test_missions_without_onboard_settings_keep_their_bytes_and_name():
    mission = short_mission(onboard=None)
    legs = [[0, 10000, 0, 5000, 60, 833, 1900, 0, 0, 0], [0, 20000, 0, 0, 60, 833, 1900, 0, 0, 0]]
    expected = [2, [10000, 12000, 3600, 0, 0, 0, 0], legs]
    assert mission.canonical_bytes() == cbor2.dumps(expected, canonical=True)
    first = Mission.from_legs(mission.settings, mission.legs, 1)
    expected = [1, [10000, 12000, 3600, 0, 0], legs]
    assert first.canonical_bytes() == cbor2.dumps(expected, canonical=True)
    third = short_mission()
    assert cbor2.loads(third.canonical_bytes())[3] == list(ONBOARD.integers())
    assert len({first.sha256(), mission.sha256(), third.sha256()}) == 3


def test_only_format_3_carries_onboard_settings():
    mission = short_mission()
    with pytest.raises(ValueError, match="only format 3 of missions carries onboard settings"):
        Mission.from_legs(mission.settings, mission.legs, 2, onboard=ONBOARD)
    with pytest.raises(ValueError, match="only format 3"):
        Mission.from_legs(mission.settings, mission.legs, 3)
    with pytest.raises(ValueError, match="format 6 of missions is unknown"):
        Mission.from_legs(mission.settings, mission.legs, 6)
    with pytest.raises(ValueError, match="format 4 of missions has an order and no legs"):
        Mission.from_legs(mission.settings, mission.legs, 4)
    with pytest.raises(ValueError, match="no format of missions has 5 numbers of settings"):
        Mission.from_integers((1, 2, 3, 4, 5), (), ONBOARD)


def changed(index: int, value: int) -> tuple[int, ...]:
    integers = list(ONBOARD.integers())
    integers[index] = value
    return tuple(integers)


PRICES, THRESHOLDS = 13, 20
"""Where the energy prices begin, and where the number of thresholds stands."""


@pytest.mark.parametrize(
    ("integers", "sentence"),
    [
        (changed(0, 6), "controller 6 of onboard settings is unknown"),
        (changed(1, 12), "controller.backstepping has 11 gains, not 12"),
        (changed(12, 2), "is_tail_clipped_first of onboard settings is none of its choices"),
        (changed(PRICES, -17), "greater than or equal to 0"),
        (changed(THRESHOLDS, 5), "have 5 fidelity thresholds"),
        (changed(THRESHOLDS + 1, 16 * 4000), "do not ascend"),
        (changed(THRESHOLDS + 3, 4), "kernel shape 4 of onboard settings is unknown"),
        (ONBOARD.integers()[:-1], "cut short"),
        ((*ONBOARD.integers(), 0, 1), "followed by more"),
        (changed(5, 2**24), "too large"),
    ],
)
def test_settings_that_are_none_are_refused_with_a_sentence(integers, sentence):
    with pytest.raises(ValueError, match=sentence):
        OnboardSettings.from_integers(integers)


def test_controller_that_the_catalogue_does_not_have_cannot_travel():
    with pytest.raises(ValueError, match=r"'controller\.sail' cannot travel"):
        OnboardSettings.of("controller.sail", BacksteppingConfig(), PLANNER, FIELD)
