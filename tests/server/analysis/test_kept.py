"""Columns that were read once are kept for the next figure, for as long as they are true."""

import os
from contextlib import contextmanager
from dataclasses import replace
from datetime import timedelta

import numpy as np
import pytest

from db.column import microseconds
from db.quality_tables import QualityRunRow
from db.query.fleet.deployment_change import end_deployment
from db.query.fleet.robots import add_robot
from db.query.measured.quality import add_manual_flag
from db.query.station.events import add_event
from db.store import Store
from server.analysis import column, kept
from server.analysis.column import read_table
from server.analysis.question import question_of
from server.delivery import quality_task
from server.delivery.quality import wanted_of, write_run
from tests.db.conftest import START, report, robot_record, sample
from tests.server.delivery.written import told

ROWS = 200
LAST = START + timedelta(hours=1)
HALF_STEP = timedelta(seconds=1)


@pytest.fixture
def store(tmp_path):
    """A database with a deployment that is over."""
    store = Store.open(f"sqlite:///{tmp_path / 'over.sqlite3'}")
    store.change(lambda session: add_robot(session, robot_record())).result()
    store.append(told(ROWS, ("temperature", "chlorophyll"))).result()
    store.change(lambda session: end_deployment(session, "deployment-1", LAST)).result()
    yield store
    store.close()


@pytest.fixture
def rows_of(store, tmp_path):
    """Return the rows of some series, and how often those of the database were read."""
    reads = []

    @contextmanager
    def counted():
        original = column.blocks_of

        def blocks(*asked):
            reads.append(asked)
            return original(*asked)

        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(column, "blocks_of", blocks)
            yield

    def ask(*keys, **more):
        with counted(), store.read() as session:
            question = question_of(session, "deployment-1", "", keys, **more)
            question = replace(question, kept_in=tmp_path / "kept")
            table = read_table(session, question, lambda: False)
        return table, len(reads)

    return ask


def same(one, other):
    return all(
        np.array_equal(getattr(one, name), getattr(other, name), equal_nan=True)
        for name in ("at_us", "dive", "leg", "depth_m")
    ) and all(
        np.array_equal(values, other.values[key], equal_nan=True)
        for key, values in one.values.items()
    )


def test_the_next_figure_of_the_same_series_reads_nothing_and_shows_the_same(rows_of):
    first, _ = rows_of("temperature")
    again, reads = rows_of("temperature")
    assert (reads, same(first, again)) == (1, True)
    part, reads = rows_of("temperature", dives="1-2", flag_max=3)
    assert reads == 1
    assert 0 < len(part) < len(first)
    _, reads = rows_of("chlorophyll")
    assert reads == 2, "those of other series were not read yet"


@pytest.mark.parametrize("what", ["state", "sample", "import"])
def test_what_comes_later_is_shown(rows_of, store, what):
    first, _ = rows_of("temperature")
    late = sample(999_000, 12.5, variable="temperature")
    late = replace(late, measured_at=START + timedelta(minutes=30))
    if what == "state":
        store.append([report(1900.0, depth_m=0.9)]).result()
    elif what == "sample":
        store.append([late]).result()
    else:
        text = "Rows of a card were merged."
        store.change(
            lambda s: add_event(s, LAST, "deployment.imported", text, robot="mini-1")
        ).result()
    again, reads = rows_of("temperature")
    assert reads == 2
    assert len(again) == len(first) + (what == "sample")


def test_a_flag_of_a_person_counts_at_once_and_nothing_is_read_for_it(rows_of, store):
    first, _ = rows_of("temperature")
    assert set(first.flags["temperature"].tolist()) == {0}
    store.change(
        lambda session: add_manual_flag(
            session,
            "deployment-1",
            series="temperature",
            first_at=START,
            last_at=LAST,
            flag=4,
            reason="Mud",
            at=LAST,
            by="ann",
        )
    ).result()
    again, reads = rows_of("temperature")
    assert reads == 1
    assert set(again.flags["temperature"].tolist()) == {4}


@pytest.fixture
def check(store, tmp_path):
    """Run the rules as the station does, or as one of before that did not keep what it saw."""

    def run(*, as_of_old=False):
        with store.read() as session:
            wanted = wanted_of(session, "deployment-1", f"sqlite:///{tmp_path / 'over.sqlite3'}")
        found = quality_task.run(wanted, lambda _: None, lambda: False)

        def write(session):
            kept_run = write_run(session, wanted, found, LAST + timedelta(days=1), "ann")
            if as_of_old:
                session.get(QualityRunRow, kept_run.key).seen = None

        store.change(write).result()

    return run


def test_what_came_after_a_check_is_not_called_good(rows_of, store, check):
    late = replace(
        sample(999_000, 900.0, variable="temperature"), measured_at=START + timedelta(seconds=33)
    )
    check()
    before, _ = rows_of("temperature")
    assert set(before.flags["temperature"].tolist()) <= {1, 3}
    store.append([late]).result()
    after, _ = rows_of("temperature")
    new = after.at_us == microseconds(late.measured_at)
    assert after.flags["temperature"][new].tolist() == [0]
    assert np.array_equal(after.flags["temperature"][~new], before.flags["temperature"])
    check()
    again, _ = rows_of("temperature")
    assert again.flags["temperature"][new].tolist() == [4]


def test_a_run_that_did_not_keep_what_it_saw_counts_while_nothing_came(rows_of, store, check):
    check(as_of_old=True)
    before, _ = rows_of("temperature")
    assert 1 in before.flags["temperature"]
    store.append(
        [replace(sample(999_000, 9.0, variable="temperature"), measured_at=START)]
    ).result()
    same_moment, _ = rows_of("temperature")
    assert 1 in same_moment.flags["temperature"], "of two values of a moment one counts"
    late = replace(sample(999_001, 9.0, variable="temperature"), measured_at=START + HALF_STEP)
    store.append([late]).result()
    after, _ = rows_of("temperature")
    assert set(after.flags["temperature"].tolist()) == {0}


def test_the_oldest_goes_where_there_is_no_room(rows_of, tmp_path, monkeypatch):
    rows_of("temperature")
    (first,) = (tmp_path / "kept").iterdir()
    os.utime(first, (1.0, 1.0))
    monkeypatch.setattr(kept, "BYTES_MAX", 2 * first.stat().st_size + 10_000)
    rows_of("chlorophyll")
    rows_of("temperature", "chlorophyll")
    left = set((tmp_path / "kept").iterdir())
    assert first not in left
    assert len(left) >= 1
    monkeypatch.setattr(kept, "BYTES_MAX", 10)
    rows_of("pitch_rad")
    assert set((tmp_path / "kept").iterdir()) == left, "what is too large alone is not kept"


def test_what_cannot_be_read_is_read_anew(rows_of, tmp_path):
    first, _ = rows_of("temperature")
    (place,) = (tmp_path / "kept").iterdir()
    place.write_bytes(b"PK broken")
    again, reads = rows_of("temperature")
    assert (reads, same(first, again)) == (2, True)
    assert rows_of("temperature")[1] == 2


def test_nothing_is_kept_while_the_deployment_lasts(tmp_path):
    store = Store.open(f"sqlite:///{tmp_path / 'other.sqlite3'}")
    store.change(lambda session: add_robot(session, robot_record())).result()
    store.append(told(20, ("temperature",))).result()
    with store.read() as session:
        question = question_of(session, "deployment-1", "", ["temperature"])
        question = replace(question, kept_in=tmp_path / "kept")
        assert kept.place_of(session, question) is None
    store.close()
