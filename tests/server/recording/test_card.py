"""A recovered card joins telemetry by log and number: each measurement is kept once."""

import math
import random
from dataclasses import replace
from datetime import timedelta

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from db.ingest import append_telemetry
from db.query.fleet.deployments import list_deployments
from db.query.fleet.robots import add_robot
from db.query.measured.detections import detections
from db.query.measured.merged_rows import iterate_rows
from db.query.measured.samples import sample_columns
from db.query.measured.telemetry import history, track
from db.store import Store
from onboard.link.sample_file import FileSampleLog
from onboard.log import FileLog
from robot_link.mavlink import telemetry
from robot_link.messages import LogId, RobotId
from robot_link.sample_log import HeardTag, Measurement
from robot_link.satellite.octets import OctetReader
from robot_link.satellite.sample_code import packed_samples, unpacked_samples
from server.delivery.files import mode_of
from server.recording.card import CardOrder, CardRefusedError, keep_card, travelled
from server.recording_file.card import Card, read_card
from server.recording_file.raw import UnreadableError
from server.recording_file.reading import read_files
from tests.db.conftest import START, report, robot_record, sample

LOG = LogId(7)
AT = START + timedelta(days=1)
ROWS = 120


@pytest.fixture
def store(tmp_path):
    store = Store.open(f"sqlite:///{tmp_path / 'station.sqlite3'}")
    store.change(lambda session: add_robot(session, robot_record())).result()
    yield store
    store.close()


def measurement(number, value=None):
    return Measurement(
        "temperature",
        10.0 + number / 7 if value is None else value,
        (1.0 + number / 700, 0.5, 0.2 + number / 900),
        0.03,
        START + timedelta(seconds=2 * number),
    )


def tag(number):
    at = START + timedelta(seconds=2 * number + 1)
    return HeardTag(450052, "A69-1601-179", None, (1.0, 0.5, 0.2), 0.03, at)


def card_file(folder, entries):
    """Write a card as the program on board does."""
    folder.mkdir(parents=True, exist_ok=True)
    log = FileSampleLog(folder / "samples", LOG)
    for entry in entries:
        log.append(entry)
    return folder / "samples"


def card_of(folder, entries):
    return read_card([("samples", card_file(folder, entries))], lambda share: None)


def by_radio(number, entry):
    """Return a sample as it comes by radio: its numbers are floats of 32 bits."""
    message = telemetry.sample_message(LOG, number, entry)
    packed = message.pack(telemetry.grace.MAVLink(None))
    told = telemetry.grace.MAVLink(None).decode(bytearray(packed))
    return telemetry.sample(told, RobotId("mini-1"), AT)


def by_satellite(numbers):
    whole = [
        replace(
            sample(number, variable="temperature"),
            value=entry.value,
            position_ned=entry.position_ned,
            measured_at=entry.measured_at,
        )
        for number in numbers
        for entry in [measurement(number)]
    ]
    return unpacked_samples(OctetReader(packed_samples(whole)), RobotId("mini-1"), AT)


def told(store, values):
    store.change(lambda session: append_telemetry(session, list(values))).result()


def joined(store, card, **more):
    order = CardOrder("mini-1", card, (), "ann", AT, skips_faults=False)
    order = replace(order, **more)
    kept = store.change(lambda session: keep_card(session, order, lambda: None)).result()
    assert card.read == kept.new + kept.duplicate + kept.differs + len(kept.faults)
    return kept


def counts(kept):
    return kept.new, kept.duplicate, kept.differs, len(kept.faults)


def final_values(store, *, smoothed=True):
    with store.read() as session:
        (deployment,) = list_deployments(session, robot="mini-1")
        blocks = list(iterate_rows(session, deployment, ["temperature"], smoothed=smoothed))
        assert sum(block.left_out for block in blocks) == 0
        values = np.concatenate([block.value["temperature"] for block in blocks])
    return values[np.isfinite(values)]


def test_a_card_after_telemetry_with_a_third_lost_keeps_each_measurement_once(store, tmp_path):
    entries = [measurement(number) for number in range(ROWS)]
    came = [number for number in range(ROWS) if random.Random(number).random() > 0.3]
    told(store, [by_radio(number, entries[number]) for number in came if number < 60])
    told(store, by_satellite([number for number in came if number >= 60]))
    card = card_of(tmp_path / "card", entries)
    assert counts(joined(store, card)) == (ROWS - len(came), len(came), 0, 0)
    assert final_values(store).tolist() == [entry.value for entry in entries]
    assert len(final_values(store, smoothed=False)) == ROWS
    assert counts(joined(store, card)) == (0, ROWS, 0, 0)
    with store.read() as session:
        columns = sample_columns(session, "mini-1", "temperature")
        (deployment,) = list_deployments(session, robot="mini-1")
    assert columns.sequence.tolist() == list(range(ROWS))
    assert mode_of(deployment) == "P"


def test_another_value_is_kept_beside_telemetrys_and_counts_in_a_reviewed_file(store, tmp_path):
    told(store, [by_radio(number, measurement(number)) for number in range(10)])
    card = card_of(tmp_path, [measurement(n, 20.0 if n == 4 else None) for n in range(10)])
    kept = joined(store, card)
    assert counts(kept) == (0, 9, 1, 0)
    assert any("1 measurements say something else" in note for note in kept.notes)
    assert final_values(store)[4] == 20.0
    assert final_values(store, smoothed=False)[4] == np.float32(measurement(4).value)


def test_heard_tags_of_a_card_are_kept_once(store, tmp_path):
    card = card_of(tmp_path, [measurement(0), tag(1), tag(2)])
    assert counts(joined(store, card)) == (3, 0, 0, 0)
    assert counts(joined(store, card)) == (0, 3, 0, 0)
    with store.read() as session:
        assert len(list(detections(session, ("mini-1",)))) == 2


def test_lines_that_are_broken_are_named_and_refuse_the_card_or_are_skipped(store, tmp_path):
    path = card_file(tmp_path, [measurement(number) for number in range(6)])
    lines = path.read_bytes().splitlines(keepends=True)
    deep = measurement(7)
    other = card_file(tmp_path / "deep", [replace(deep, position_ned=(1.0, 0.5, 5000.0))])
    path.write_bytes(b"".join([*lines[:2], lines[2][:40] + b"\n", *lines[3:], lines[0]]))
    card = read_card([("samples", path)], lambda share: None)
    assert (len(card.entries), card.repeated) == (5, 1)
    assert [(one.place, one.reason) for one in card.faults] == [("line 3", "the line is not whole")]
    with pytest.raises(CardRefusedError, match=r"1 of 7 lines cannot be used.*line 3") as refused:
        joined(store, card)
    assert len(refused.value.faults) == 1
    assert counts(joined(store, card, skips_faults=True)) == (5, 1, 0, 1)
    card = read_card([("deep", other)], lambda share: None)
    with pytest.raises(CardRefusedError, match="No line of the card can be used"):
        joined(store, card)


def test_a_card_whose_clock_is_off_waits_for_a_person(store, tmp_path):
    told(store, [by_radio(number, measurement(number)) for number in range(0, 40, 2)])
    late = timedelta(seconds=37)
    entries = [measurement(number) for number in range(40)]
    card = card_of(tmp_path, [replace(one, measured_at=one.measured_at + late) for one in entries])
    with pytest.raises(CardRefusedError, match=r"37\.000 s ahead of telemetry's"):
        joined(store, card)
    kept = joined(store, card, clock_offset_s=37.0)
    assert counts(kept) == (20, 20, 0, 0)
    assert kept.notes[0] == "Every time of the card was moved by -37.000 s, as ann said."
    with store.read() as session:
        times = sample_columns(session, "mini-1", "temperature").measured_at_us
    assert set(np.diff(times).tolist()) == {2_000_000}


def test_a_card_of_nobody_or_of_another_robot_is_refused(store, tmp_path):
    card = card_of(tmp_path, [measurement(0)])
    with pytest.raises(CardRefusedError, match="belongs to a robot that this station knows"):
        joined(store, card, robot="eva")
    other = replace(robot_record("mini-2", 2), links=())
    store.change(lambda session: add_robot(session, other)).result()
    told(store, [by_radio(0, measurement(0))])
    with pytest.raises(CardRefusedError, match="are those of mini-1, not of mini-2"):
        joined(store, card, robot="mini-2")


def test_a_memory_without_an_entry_is_no_card(tmp_path):
    path = tmp_path / "samples"
    path.write_bytes(b'00000000 {"log": 1, "stored": [0]}\n')
    with pytest.raises(UnreadableError, match="has no measurement"):
        read_card([("samples", path)], lambda share: None)


@settings(max_examples=12, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(st.sets(st.integers(0, 30)), st.permutations(range(4)), st.integers(1, 30))
def test_the_order_of_cards_does_not_matter(tmp_path_factory, came, order, cut):
    """Whole cards, parts and copies: the same rows are kept, and each line is told of."""
    folder = tmp_path_factory.mktemp("order")
    entries = [measurement(number) for number in range(31)]
    whole = card_of(folder, entries)
    part = replace(whole, entries=whole.entries[:cut])
    rest = replace(whole, entries=whole.entries[cut - 1 :])
    cards: list[Card] = [whole, part, rest, whole]
    store = Store.open(f"sqlite:///{folder / 'station.sqlite3'}")
    try:
        store.change(lambda session: add_robot(session, robot_record())).result()
        told(store, [by_radio(number, entries[number]) for number in sorted(came)])
        new = sum(joined(store, cards[place]).new for place in order)
        assert new == 31 - len(came)
        assert final_values(store).tolist() == [entry.value for entry in entries]
    finally:
        store.close()


@given(st.floats(-1e30, 1e30, allow_subnormal=False))
def test_what_a_wire_makes_of_a_value_is_the_same_value(value):
    card = np.array([value])
    single = float(np.float32(value))
    assert travelled(card, np.array([single]))[0]
    assert travelled(card, card)[0]
    if abs(value) > 1e-30:
        assert not travelled(card, np.array([single * 1.001]))[0]


def test_the_track_on_a_card_fills_what_telemetry_did_not_tell(store, tmp_path):
    log = FileLog(tmp_path / "log", START)
    for number in range(12):
        log.track(report(5 * number, 0.1 + 0.01 * number))
    log.close()
    (path,) = (tmp_path / "log").glob("track-*.csv")
    told(store, [report(0, 0.123456789), replace(report(15), pitch_rad=math.nan)])
    with path.open("a") as file:
        file.write("2026-11-21T04:")
    files = [("track.csv", path), ("samples", card_file(tmp_path, [measurement(0)]))]
    files.append(("events.txt", next((tmp_path / "log").glob("events-*"))))
    card = read_files(files, tmp_path, lambda share: None)
    assert card.left_out == ("events.txt",)
    assert [one.reason for one in card.faults] == ["the line is not whole"]
    assert counts(joined(store, card, skips_faults=True)) == (11, 2, 0, 1)
    assert counts(joined(store, card, skips_faults=True)) == (0, 13, 0, 1)
    with store.read() as session:
        points = track(session, "mini-1").points
        pitch = history(session, "mini-1", "pitch_rad", START, AT)
    assert len(points) == 12
    assert points[0].position_ned[2] == 0.123456789
    assert len(pitch.value) == 12
    assert all(map(math.isfinite, pitch.value))
