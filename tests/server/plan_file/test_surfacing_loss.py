"""Whatever a design says of surfacing and a plan file does not is told before it is saved."""

from datetime import UTC, datetime

import pytest

from autonomy.design.document import Design, SurfacingRules, ValueRule
from server.plan_file.loss import losses_of

OTHERWISE = {
    "at_waypoints": False,
    "every_s": 1234.0,
    "at_utc": (datetime(2026, 6, 1, 12, tzinfo=UTC),),
    "max_uncertainty_m": 12.0,
    "samples_waiting": 40,
    "on_value": (ValueRule(channel="temperature", side="above", value=21.5),),
    "hold_off_s": 90.0,
}


@pytest.mark.parametrize("format", ["qgc_plan", "wpl", "kml", "geojson", "csv"])
@pytest.mark.parametrize("field", SurfacingRules.model_fields)
def test_each_rule_of_surfacing_is_a_loss(format, field):
    changed = Design(surfacing=SurfacingRules(**{field: OTHERWISE[field]}))
    before, after = (losses_of(format, one, (), ()) for one in (Design(), changed))
    assert len(after) == len(before) + 1
