"""Rows that come in twice are kept once, in whatever order their files come."""

import hashlib
import itertools
from datetime import UTC, datetime

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from autonomy.channel import CHANNELS
from db.query.fleet.deployment_change import void_deployment
from db.query.fleet.deployments import list_deployments
from db.query.fleet.recordings import DeploymentExistsError, ImportedFile
from db.query.measured import imported
from db.query.measured.samples import sample_columns
from db.query.measured.telemetry import track
from db.store import Store
from server.recording.duplicate import matches
from server.recording.foreign import recording_of
from server.recording.keep import hold, keep_recording, source_of
from server.recording.table import Recording
from server.recording_file.conversion import convert
from server.recording_file.mapping import proposed
from tests.server.recording_file.reading_of import read
from tests.server.recording_file.test_figures import BASE, CACHES, public

BEGIN_S = 1_600_000_000.0
NOW = datetime(2026, 11, 28, tzinfo=UTC)


def recording(times_s, shift=0.0):
    """A yo whose temperature follows from the time alone."""
    at = np.asarray(times_s, dtype=np.float64)
    depth = 20.0 + 10.0 * np.sin(at / 50.0)
    return Recording(
        BEGIN_S + at,
        48.9 + 1e-6 * at,
        np.full(len(at), -130.6),
        depth,
        {"temperature": 10.0 + np.sin(at / 30.0) + shift},
        {},
        (),
    )


def converted(folder, paths):
    raw = read(folder, paths)
    return convert(raw, proposed(raw, CHANNELS), CHANNELS)


def held(store, rows):
    with store.read() as session:
        return hold(session, "eva", rows)


def kept(store, name, rows, before=None):
    digest = hashlib.sha256(name.encode()).hexdigest()
    source = source_of(name, (ImportedFile(name, digest),))
    return store.change(
        lambda session: keep_recording(session, "eva", rows, source, at=NOW, by="ann", held=before)
    ).result()


def told(store):
    with store.read() as session:
        columns = sample_columns(session, "eva", "temperature")
        counts = {one.id: one.rows for one in list_deployments(session)}
        states = [point.measured_at for point in track(session, "eva").points]
    rows = zip(columns.measured_at_us.tolist(), columns.value.tolist(), strict=True)
    return list(rows), counts, states


@pytest.fixture
def stores(tmp_path):
    numbers = itertools.count()
    opened = []

    def new():
        store = Store.open(f"sqlite:///{tmp_path / f'{next(numbers)}.sqlite3'}")
        opened.append(store)
        return store

    yield new
    for store in opened:
        store.close()


def test_a_denser_file_takes_the_place_of_a_sparse_one_in_either_order(stores):
    sparse, dense = recording(np.arange(0.0, 200.0, 10.0)), recording(np.arange(0.0, 200.0, 2.0))
    there, back = stores(), stores()
    first = kept(there, "sbd", sparse)
    assert (first.new, first.duplicate, first.differs) == (20, 0, 0)
    second = kept(there, "dbd", dense)
    assert (second.new, second.duplicate, second.differs) == (80, 20, 0)
    assert second.deployment.id == first.deployment.id
    assert kept(back, "dbd", dense).new == 100
    again = kept(back, "sbd", sparse)
    assert (again.new, again.duplicate) == (0, 20)
    assert told(there) == told(back)
    assert told(there)[1] == {"deployment-1": 100}


def test_while_a_recording_is_written_nothing_is_read_of_what_is_kept(stores, monkeypatch):
    """The writer is one for all: what takes long is done before."""
    store, rows = stores(), recording(np.arange(0.0, 200.0, 2.0))
    kept(store, "sbd", recording(np.arange(0.0, 200.0, 10.0)))
    before = held(store, rows)
    monkeypatch.setattr(imported, "known_samples", None)
    monkeypatch.setattr(imported, "known_states", None)
    again = kept(store, "dbd", rows, before)
    assert (again.new, again.duplicate) == (80, 20)


@pytest.mark.parametrize("change", ["other rows", "denser rows", "a void deployment"])
def test_a_recording_is_held_anew_against_what_was_kept_meanwhile(stores, change):
    rows = recording(np.arange(0.0, 200.0, 10.0))
    outcome = []
    for is_held in (True, False):
        store = stores()
        kept(store, "first", recording(np.arange(0.0, 100.0, 10.0)))
        before = held(store, rows) if is_held else None
        if change == "other rows":
            kept(store, "second", recording(np.arange(100.0, 150.0, 10.0)))
        elif change == "denser rows":
            kept(store, "second", recording(np.arange(0.0, 200.0, 5.0)))
        else:
            store.change(
                lambda s: void_deployment(s, "deployment-1", "It was the wrong robot.", NOW)
            ).result()
        counts = kept(store, "third", rows, before)
        outcome.append((counts.new, counts.duplicate, counts.differs, told(store)))
    assert outcome[0] == outcome[1]


def test_what_a_slocum_sent_from_the_surface_is_in_its_own_files(stores, tmp_path):
    """Both ways round the same is kept, and each row is told of.

    The short science file repeats what its computer measured up to a cycle before: of its rows 16
    are by two milliseconds farther away from there than half of the long file's interval.
    """
    caches = public(*CACHES)
    short, long = (
        converted(tmp_path / endings[0], [*public(*(f"{BASE}.{e}" for e in endings)), *caches])
        for endings in (("sbd", "tbd"), ("dbd", "ebd"))
    )
    rows = [recording_of(one) for one in (short, long)]
    there, back = stores(), stores()
    first, second = kept(there, "short", rows[0]), kept(there, "long", rows[1])
    assert (first.new, first.duplicate, first.differs) == (len(rows[0].time_s), 0, 0)
    assert second.new + second.duplicate + second.differs == len(rows[1].time_s)
    assert kept(back, "long", rows[1]).new == len(rows[1].time_s)
    again = kept(back, "short", rows[0])
    assert (again.new, again.duplicate, again.differs) == (16, len(rows[0].time_s) - 16, 0)
    assert told(there)[0] == told(back)[0]


def test_the_same_rows_again_change_nothing_and_the_same_file_is_refused(stores):
    store, rows = stores(), recording(np.arange(0.0, 100.0, 5.0))
    kept(store, "a", rows)
    before = told(store)
    with pytest.raises(DeploymentExistsError, match="as deployment-1 of eva"):
        kept(store, "a", rows)
    again = kept(store, "the same in another file", rows)
    assert (again.new, again.duplicate, again.differs) == (0, 20, 0)
    assert told(store) == before


def test_another_value_of_a_moment_is_counted_and_the_first_stays(stores):
    store = stores()
    kept(store, "a", recording([0.0, 5.0, 10.0]))
    before = told(store)
    again = kept(store, "b", recording([0.0, 5.0, 10.0], shift=0.5))
    assert (again.new, again.duplicate, again.differs) == (0, 0, 3)
    assert told(store) == before


def test_dives_that_do_not_meet_are_deployments_of_their_own(stores):
    store = stores()
    assert kept(store, "a", recording([0.0, 5.0])).deployment.id == "deployment-1"
    assert kept(store, "b", recording([500.0, 505.0])).deployment.id == "deployment-2"


TIMES = st.lists(st.integers(0, 400), min_size=1, max_size=40, unique=True).map(sorted)


@settings(max_examples=200, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(TIMES, TIMES)
def test_each_measurement_is_matched_once_and_with_itself_completely(one, other):
    def series(times):
        at = np.array(times, dtype=np.int64) * 1_000_000
        return at, np.sin(at / 7e6)

    itself = matches(*series(one), *series(one))
    assert itself.known.tolist() == list(range(len(one)))
    assert not itself.differs.any()
    found = matches(*series(one), *series(other))
    used = found.known[found.known >= 0]
    assert len(set(used.tolist())) == len(used)
    common = set(one) & set(other)
    assert {other[row] for row in np.flatnonzero(found.known >= 0)} >= common
    back = matches(*series(other), *series(one))
    assert (found.known >= 0).sum() == (back.known >= 0).sum()
