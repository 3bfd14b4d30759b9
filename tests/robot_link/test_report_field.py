"""The catalogue of a state: every row has all of its faces, and one row more is all it takes."""

import subprocess
import sys
from pathlib import Path

import pytest

from db.tables import StateRow
from robot_link.mavlink.build import HERE, build
from robot_link.mavlink.wire import grace
from robot_link.messages import STATE
from robot_link.satellite.state_code import STATE_BYTES

MESSAGE = grace.MAVLink_grace_state_message
BESIDE = {"time_utc_us", "mode", "flags"}
"""Fields of the dialect's state that are no channels."""
NOT_BY_SATELLITE = {"energy_used"}
"""The plan's report in the same record says it."""
UNITS = {("m", 1.0): "m", ("kg", 1.0): "kg", ("m/s", 1e3): "mm/s", ("V", 1e3): "mV"}
"""Units of the dialect by those of a channel and its scale."""


def test_every_field_of_the_dialects_state_is_a_channel_of_the_same_unit():
    wires = [channel.wire for channel in STATE.channels]
    assert sorted(wire.field for wire in wires) == sorted(set(MESSAGE.fieldnames) - BESIDE)
    for channel in STATE.channels:
        unit = UNITS.get((channel.unit, channel.wire.scale), "")
        assert MESSAGE.fieldunits_by_name.get(channel.wire.field, "") == unit


def test_octets_of_the_satellite_record_follow_one_another_and_say_the_unit_finely_enough():
    octets = {channel.key: channel.octets for channel in STATE.channels}
    assert {key for key, found in octets.items() if found is None} == NOT_BY_SATELLITE
    places = sorted(found.place for found in octets.values() if found is not None)
    assert places == list(range(len(places)))
    assert STATE_BYTES == 33


def test_every_channel_has_a_column_and_whatever_a_screen_shows_a_title():
    assert set(STATE.keys) < set(StateRow.__table__.columns.keys())
    assert sorted(gauge.place for gauge in STATE.gauges.values()) == list(range(len(STATE.gauges)))
    assert all(
        gauge.title and gauge.help and gauge.limit_s > 0.0 for gauge in STATE.gauges.values()
    )


def test_names_of_a_recordings_columns_say_the_unit_of_the_file():
    assert STATE["pitch_rad"].display_key == "pitch_deg"
    assert STATE["net_buoyancy_kg"].display_key == "net_buoyancy_g"
    assert STATE["position_std_m"].display_key == "position_std_m"


def test_a_computed_channel_is_the_length_of_its_parts():
    north, east, down = STATE.parts_of_norm("speed_m_s")
    assert (north, east, down) == ("velocity_north_m_s", "velocity_east_m_s", "velocity_down_m_s")
    assert "speed_m_s" not in STATE.keys
    assert STATE.parts_of_norm("depth_m") is None


@pytest.fixture(scope="module")
def wider_dialect(tmp_path_factory) -> Path:
    """The dialect with one field more."""
    folder = tmp_path_factory.mktemp("dialect")
    last = '      <field type="uint8_t" name="flags" enum="GRACE_STATE_FLAGS"'
    field = '      <field type="uint16_t" name="hull_temperature" units="cK">Of the hull.</field>\n'
    text = (HERE / "grace.xml").read_text()
    source = folder / "source.xml"
    source.write_text(text.replace(last, field + last, 1))
    assert source.read_text() != text
    target = folder / "grace.py"
    build(target, source)
    return target


def test_one_row_more_travels_from_the_robots_state_to_gauges_files_and_rows(wider_dialect):
    script = Path(__file__).parent / "one_more_field.py"
    done = subprocess.run(
        [sys.executable, str(script), str(wider_dialect)],
        cwd=HERE.parents[1],
        capture_output=True,
        text=True,
        timeout=100,
        check=False,
    )
    assert done.returncode == 0, done.stderr[-2000:]
    assert done.stdout.split() == [
        "mavlink",
        "satellite",
        "log",
        "database",
        "check",
        "gauge",
        "file",
    ]
