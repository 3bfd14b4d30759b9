"""The settings of the first map of a water."""

import pytest

from autonomy.channel import CHANNELS
from autonomy.field.config import FIELD_PRESETS, FieldConfig
from autonomy.field.preset import field_preset
from autonomy.site import LAKE, TANK


@pytest.mark.parametrize("site", [TANK, LAKE])
def test_a_delivered_water_has_its_own_preset(site):
    assert field_preset(site) is FIELD_PRESETS[site.variable]


def test_another_channel_is_mapped_by_its_range_and_the_size_of_the_water():
    wide = LAKE.domain.model_copy(update={"x_max_m": 40.0 + 10.0 * 420.0})
    site = LAKE.model_copy(update={"variable": "salinity", "kind": "sea", "domain": wide})
    found, lake = field_preset(site), FIELD_PRESETS["chlorophyll"]
    assert (found.variable, found.prior_mean) == ("salinity", 22.5)
    assert found.single.signal_variance == pytest.approx((45.0 / 4.0) ** 2)
    assert found.single.length_x_m == pytest.approx(10.0 * lake.single.length_x_m)
    assert found.single.length_y_m == lake.single.length_y_m


@pytest.mark.parametrize(
    "variable", [*(key for key, one in CHANNELS.items() if one.can_map), "own_channel"]
)
@pytest.mark.parametrize("site", [TANK, LAKE])
def test_every_channel_that_can_be_mapped_has_settings_in_their_bounds(site, variable):
    found = field_preset(site.model_copy(update={"variable": variable}))
    assert FieldConfig.model_validate(found.model_dump()) == found
    assert found.variable == variable
