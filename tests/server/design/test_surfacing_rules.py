"""Rules of surfacing of a design become what travels, or are refused by their field."""

import numpy as np
import pytest
from pydantic import ValidationError

from autonomy.channel import CHANNELS, OWN_WIRE_NUMBERS, Channel
from autonomy.design.document import SurfacingRules, ValueRule
from robot_link.surfacing_order import ValueLimit
from server.design.outline import surfacing_order
from server.plan.document import rule_texts


def oxygen(**changes) -> ValueRule:
    return ValueRule(**({"channel": "dissolved_oxygen", "side": "below", "value": 4.0} | changes))


def test_no_rules_of_the_robot_travel_as_none():
    assert surfacing_order(SurfacingRules(), CHANNELS) is None


def test_rules_travel_by_the_numbers_of_their_channels_and_are_said_in_words():
    rng = np.random.default_rng()
    samples, value = int(rng.integers(1, 1000)), round(float(rng.uniform(0.0, 50.0)), 3)
    rules = SurfacingRules(samples_waiting=samples, on_value=(oxygen(value=value),), hold_off_s=90)
    order = surfacing_order(rules, CHANNELS)
    assert order is not None
    assert (order.samples_waiting, order.hold_off_s) == (samples, 90)
    number = CHANNELS["dissolved_oxygen"].wire_number
    assert order.on_value == (ValueLimit(number, is_above=False, limit=pytest.approx(value)),)
    texts = rule_texts({"surfacing_rules": list(order.integers())})
    assert texts == [f"{samples:,} samples wait", f"dissolved oxygen is below {value:g} mg/L"]


@pytest.mark.parametrize(
    ("rule", "message"),
    [
        (oxygen(channel="kryptonite"), r"on_value\.0\.channel: .*not in the catalogue"),
        (oxygen(channel="depth_of_mind"), r"on_value\.0\.channel"),
        (oxygen(value=1000.0), r"on_value\.0\.value: dissolved oxygen lies within 0 to 50 mg/L"),
    ],
)
def test_a_rule_that_no_robot_can_keep_is_refused_by_its_field(rule, message):
    with pytest.raises(ValueError, match=message):
        surfacing_order(SurfacingRules(on_value=(rule,)), CHANNELS)


def test_a_channel_that_is_computed_ashore_brings_nobody_up():
    derived = [one for one in CHANNELS.values() if not one.wire_number]
    if not derived:
        pytest.skip("every delivered channel travels")
    with pytest.raises(ValueError, match="is computed ashore"):
        surfacing_order(SurfacingRules(on_value=(oxygen(channel=derived[0].key),)), CHANNELS)


def test_a_channel_that_the_robot_does_not_know_or_measure_brings_nobody_up():
    own = Channel("turtles", "Turtles", "1", OWN_WIRE_NUMBERS[0])
    catalogue = CHANNELS.with_own([own])
    wrong = SurfacingRules(on_value=(oxygen(channel="turtles"),))
    with pytest.raises(ValueError, match=r"^surfacing\.on_value\.0\.channel: .*does not know"):
        surfacing_order(wrong, catalogue, {own.wire_number})
    rules = SurfacingRules(on_value=(oxygen(),))
    with pytest.raises(ValueError, match=r"^surfacing\.on_value\.0\.channel: .*announced"):
        surfacing_order(rules, catalogue, {CHANNELS["temperature"].wire_number})
    number = CHANNELS["dissolved_oxygen"].wire_number
    assert surfacing_order(rules, catalogue, {number}) == surfacing_order(rules, catalogue)


def test_a_document_with_too_many_rules_or_none_that_makes_sense_is_refused():
    for wrong in (
        {"on_value": (oxygen(),) * 5},
        {"samples_waiting": 0},
        {"hold_off_s": 86_401.0},
    ):
        with pytest.raises(ValidationError) as caught:
            SurfacingRules(**wrong)
        assert caught.value.errors()[0]["loc"][0] in wrong
