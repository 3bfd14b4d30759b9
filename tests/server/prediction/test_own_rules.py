"""What a robot does by the rules of its plan is among what it does by itself."""

from types import SimpleNamespace

from autonomy.channel import CHANNELS
from robot_link.surfacing_order import SurfacingOrder, ValueLimit
from server.prediction.own_acts import _of_mission

MISSION = SimpleNamespace(
    settings=SimpleNamespace(timeout_s=3600.0, max_uncertainty_m=5.0), tracking=None
)


def acts_of(document):
    plan = SimpleNamespace(id="plan-7", running_at=None, document=document)
    known = SimpleNamespace(
        status=SimpleNamespace(
            next_surfacing=lambda: None, leg_begins_at=lambda: None, leg_now=None
        ),
        ends_s=(),
        uncertain_at=None,
    )
    return [one for one in _of_mission(known, plan, MISSION) if one.key.startswith("rule")]


def test_each_rule_is_an_act_of_its_own():
    limit = ValueLimit(CHANNELS["temperature"].wire_number, is_above=True, limit=21.5)
    order = SurfacingOrder.of(40, 120.0, [limit])
    found = acts_of({"surfacing_rules": list(order.integers())})
    assert [one.text for one in found] == [
        "It comes up early when 40 samples wait.",
        "It comes up early when temperature is above 21.5 degC.",
    ]
    assert len({one.key for one in found}) == 2
    assert {one.source for one in found} == {"plan-7 on board"}
    assert acts_of({}) == []
