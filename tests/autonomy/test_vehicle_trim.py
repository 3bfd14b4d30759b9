import pytest
from pydantic import ValidationError

from autonomy.vehicle.config import VEHICLES
from autonomy.vehicle.trim import TRIM_PRESETS, TrimConfig


def test_every_known_vehicle_starts_untrimmed():
    assert TRIM_PRESETS.keys() == VEHICLES.keys()
    for trim in TRIM_PRESETS.values():
        assert trim.net_buoyancy_offset_kg == trim.mass_position_offset_m == 0.0


@pytest.mark.parametrize(
    "wrong",
    [
        {"net_buoyancy_offset_kg": 0.31},
        {"net_buoyancy_offset_kg": float("nan")},
        {"mass_position_offset_m": -0.051},
        {"offset": 0.0},
    ],
)
def test_a_trim_beyond_reason_is_refused(wrong):
    with pytest.raises(ValidationError):
        TrimConfig(**wrong)


def test_a_trim_is_shown_in_grams_and_millimetres():
    fields = TrimConfig.model_json_schema()["properties"]
    assert fields["net_buoyancy_offset_kg"]["display_unit"] == "g"
    assert fields["mass_position_offset_m"]["display_unit"] == "mm"
