"""Rules of a mission that bring a robot up early, flown in waters and by limits that are drawn."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from autonomy.channel import CHANNELS
from onboard.flight.surfacing import SurfacingWatch
from onboard.link.robot_link import CommandOutcome
from robot_link.messages import OnboardPlanState
from robot_link.mission import Mission
from robot_link.surfacing_order import SurfacingOrder, ValueLimit
from tests.simulator.flight import Life, mission, two_dives, vee

TEMPERATURE = CHANNELS["temperature"]


def with_rules(plan: Mission, rules: SurfacingOrder) -> Mission:
    return Mission.from_legs(plan.settings, plan.legs, rules=rules)


def order(samples=None, hold_off_s=0.0, *limits: ValueLimit) -> SurfacingOrder:
    return SurfacingOrder.of(samples, hold_off_s, limits)


def reasons(life: Life) -> list[str]:
    """What the robot said of dives that ended early, each once."""
    said = [
        reason for state, *_, reason in life.notebook.plans if state is OnboardPlanState.RUNNING
    ]
    return list(dict.fromkeys(one for one in said if one))


@pytest.fixture
def rng():
    return np.random.default_rng()


def test_a_value_that_is_drawn_from_the_water_brings_the_robot_up(rng):
    """The limit is one that an earlier flight in the same water met on its descent."""
    seed = int(rng.integers(1000))
    plan = mission(*vee(), sample_period_s=1.0)
    free = Life(seed=seed)
    free.fly(plan)
    variable = free.robot.program.variable
    down = free.notebook.samples[: len(free.notebook.samples) // 2]
    descent = [value for value, place, *_ in down if 0.05 < place[2] < 0.2]  # deeper, it turns
    limit = float(rng.uniform(np.quantile(descent, 0.3), np.quantile(descent, 0.7)))
    is_above = bool(descent[0] < limit)
    number = CHANNELS[variable].wire_number
    rules = order(None, 0.0, ValueLimit(number, is_above, limit))
    ruled = Life(seed=seed)
    ruled.fly(with_rules(plan, rules))
    assert ruled.executive.plan_state is OnboardPlanState.DONE
    first = reasons(ruled)[0]
    assert first.startswith("leg 1 ended early, by rule: ")
    assert f"is {'above' if is_above else 'below'}" in first
    met = [rules.on_value[0].is_crossed(value) for value, *_ in ruled.notebook.samples]
    assert any(met)
    deepest = [max(place[2] for _, place, *_ in life.notebook.samples) for life in (free, ruled)]
    assert deepest[1] < deepest[0] + 0.01


def test_samples_that_wait_bring_it_up_and_the_next_dive_is_flown(rng):
    waits = int(rng.integers(3, 9))
    life = Life()
    plan = mission(*two_dives(), sample_period_s=1.0)
    radio = life.notebook
    assert life.start(with_rules(plan, order(waits, 10_000.0))) is CommandOutcome.DONE
    running = OnboardPlanState.RUNNING

    def flies() -> bool:
        radio.unacknowledged_samples = len(radio.samples)
        return life.executive.plan_state is not running

    assert life.live_until(flies, 900.0)
    assert life.executive.plan_state is OnboardPlanState.DONE
    (said,) = reasons(life)
    count = int(said.split("by rule: ")[1].split()[0])
    assert waits <= count <= waits + 8  # it does not come up before it is under water
    assert said == f"leg 1 ended early, by rule: {count} samples wait"
    # the hold-off lets the second dive be flown though more samples wait than before
    second = life.track[life.track[:, 0] > life.track[:, 0].max() * 0.5]
    assert second[:, 7].max() > 0.4


def test_a_rule_that_holds_all_the_time_ends_each_dive_unless_it_is_held_off():
    plan = mission(*two_dives(), sample_period_s=1.0)
    always = ValueLimit(TEMPERATURE.wire_number, True, TEMPERATURE.low)
    deepest = []
    for hold_off_s in (0.0, 10_000.0):
        life = Life()
        track = life.fly(with_rules(plan, order(None, hold_off_s, always)))
        half = np.searchsorted(track[:, 0], track[:, 0].mean())
        deepest.append((track[:half, 7].max(), track[half:, 7].max()))
        assert life.executive.plan_state is OnboardPlanState.DONE
    assert max(deepest[0]) < 0.35
    assert deepest[1][1] > 0.4


def test_danger_that_ends_a_dive_is_said_too():
    life = Life()
    life.fly(
        replace(
            mission(*two_dives()), settings=mission(*two_dives(), max_uncertainty_m=0.03).settings
        )
    )
    assert any("the position is too uncertain" in one for one in reasons(life))


def test_a_mission_without_rules_is_brought_up_by_none():
    life = Life()
    life.fly(mission(*two_dives()))
    assert reasons(life) == []


limits = st.builds(ValueLimit, st.just(TEMPERATURE.wire_number), st.booleans(), st.floats(-4, 44))


@given(limits, st.floats(TEMPERATURE.low, TEMPERATURE.high))
def test_a_value_meets_a_rule_just_where_it_is_beyond_its_limit(limit, value):
    watch = SurfacingWatch()
    watch.begin(SurfacingOrder(0, 60, (limit,)))
    watch.hear({"temperature": value})
    said = watch.met(10.0, 0, is_under_way=True)
    assert bool(said) == limit.is_crossed(value)
    watch.hear({"temperature": value})
    assert watch.met(69.0, 0, is_under_way=True) == "" or not said
    watch.hear({"temperature": value})
    assert bool(watch.met(71.0, 0, is_under_way=True)) == bool(said)


def test_what_cannot_be_true_or_was_measured_at_the_surface_meets_no_rule():
    watch = SurfacingWatch()
    watch.begin(SurfacingOrder(0, 0, (ValueLimit(TEMPERATURE.wire_number, True, 20.0),)))
    watch.hear({"temperature": TEMPERATURE.high + 1.0, "conductivity": 30.0})
    assert watch.met(1.0, 0, is_under_way=True) == ""
    watch.hear({"temperature": 25.0})
    assert watch.met(2.0, 0, is_under_way=False) == ""
    assert watch.met(3.0, 0, is_under_way=True) == ""


def test_a_channel_that_the_robot_does_not_know_meets_no_rule():
    watch = SurfacingWatch()
    watch.begin(SurfacingOrder(0, 0, (ValueLimit(239, True, 0.0),)))
    watch.hear({"temperature": 25.0})
    assert watch.met(1.0, 0, is_under_way=True) == ""
