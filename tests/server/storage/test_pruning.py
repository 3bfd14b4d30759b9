import gzip
import os
import shutil
from dataclasses import replace
from datetime import timedelta
from pathlib import Path

import pytest
from sqlalchemy import func, select, update

from db.column import microseconds
from db.quality_tables import ManualFlagRow
from db.query.fleet.robots import add_robot
from db.query.measured.rollup import counts
from db.query.measured.telemetry import history
from db.query.storage.prunable import PRUNABLE
from db.query.storage.told import pruned_stretches
from db.sample_tables import FINE_S, ReadingRow, SampleRollup, SampleRow
from db.state_sums import StateRollup, sum_up_next
from db.storage_tables import ArchiveFileRow, PrunedDayRow
from db.store import Store
from db.tables import Deployment, RawFrameRow, StateRow
from robot_link.messages import RawFrame, RobotId, StateReport
from robot_link.storage_config import StorageConfig
from server.storage.archive import ArchiveError, read_rows
from server.storage.pruning import Pruner
from server.storage.restoring import restore_file
from tests.db.conftest import robot_record
from tests.server.storage.conftest import DAY, NOW, ROBOT, day_of_robot

OLD = {"after_days": 30}


def config(**rules):
    return StorageConfig.model_validate(
        {key: {"then": then, **OLD, **more} for key, (then, more) in rules.items()}
    )


def prune(store, folder, rules, **how):
    return Pruner(store, folder, NOW).run(rules, **how)


def rows(store, model=StateRow):
    with store.read() as session:
        columns = model.__table__.columns
        keys = model.__table__.primary_key.columns
        return [tuple(row) for row in session.execute(select(*columns).order_by(*keys))]


@pytest.fixture
def kept(store, ended):
    for number in range(2):
        store.append(day_of_robot(number)).result(120)
    return store


def test_what_is_kept_for_ever_stays(kept, tmp_path):
    before = {model: rows(kept, model) for model in (StateRow, SampleRow, RawFrameRow)}
    assert prune(kept, tmp_path, StorageConfig()).rows == 0
    assert {model: rows(kept, model) for model in before} == before


def test_thinned_states_keep_surfacings_and_extremes(kept, tmp_path):
    with kept.read() as session:
        deepest = session.scalar(select(func.max(StateRow.depth_m)))
    result = prune(kept, tmp_path, config(states=("thin", {"period_s": 60})))
    left = rows(kept)
    assert result.thinned["states"] == 720 - len(left)
    # Of each hour: 60 minutes, 2 extremes of each 5 minutes, 4 rows at each of 6 surfacings.
    assert 120 <= len(left) <= 2 * (60 + 24 + 24 + 1)
    with kept.read() as session:
        assert session.scalar(select(func.max(StateRow.depth_m))) == deepest
        up = session.scalars(select(StateRow.measured_at).where(StateRow.has_fix)).all()
    begins = {DAY + timedelta(hours=10, seconds=600 * number) for number in range(6)}
    assert begins <= set(up)
    assert {at + timedelta(seconds=50) for at in begins} <= set(up)


def test_sums_of_stretches_tell_what_is_left(kept, tmp_path):
    prune(kept, tmp_path, config(samples=("thin", {"period_s": 60})))
    with kept.read() as session:
        key = session.scalars(select(SampleRow.robot_key)).first()
        counted = counts(session, SampleRow, key)["blue_light"]
        assert counted == session.scalar(select(func.count()).select_from(SampleRow))
        for stretch in session.scalars(
            select(SampleRollup).where(SampleRollup.length_s == FINE_S)
        ).all():
            found = [
                value
                for at, value in session.execute(select(SampleRow.measured_at, SampleRow.value))
                if microseconds(at) // (FINE_S * 10**6) == stretch.stretch
            ]
            assert (stretch.size, stretch.least, stretch.greatest) == (
                len(found),
                min(found),
                max(found),
            )


def test_sums_of_states_tell_what_is_left(kept, tmp_path):
    while kept.change(lambda session: sum_up_next(session, 1000, NOW)).result(120):
        pass
    prune(kept, tmp_path, config(states=("thin", {"period_s": 60})))
    with kept.read() as session:
        of_depth = select(func.sum(StateRollup.size)).where(StateRollup.channel == "depth_m")
        assert session.scalar(of_depth) == len(rows(kept))
    prune(kept, tmp_path, config(states=("delete", {})))
    assert rows(kept, StateRollup) == []


def test_deleted_samples_leave_neither_rows_nor_sums(kept, tmp_path):
    prune(kept, tmp_path, config(samples=("delete", {})))
    assert rows(kept, SampleRow) == []
    assert rows(kept, SampleRollup) == []


def test_a_sample_that_is_sent_again_does_not_come_back(kept, tmp_path):
    prune(kept, tmp_path, config(samples=("delete", {})))
    kept.append(day_of_robot(0)).result(120)
    assert rows(kept, SampleRow) == []


def test_a_second_pass_finds_nothing_to_do(kept, tmp_path):
    rules = config(states=("thin", {"period_s": 60}), samples=("thin", {"period_s": 60}))
    prune(kept, tmp_path, rules)
    assert prune(kept, tmp_path, rules).rows == 0
    assert prune(kept, tmp_path, rules, again=True).rows == 0


def test_young_rows_stay(kept, tmp_path):
    rules = config(states=("delete", {"after_days": 98}))
    prune(kept, tmp_path, rules)
    with kept.read() as session:
        left = session.scalars(select(StateRow.measured_at)).all()
    assert {at.date() for at in left} == {(DAY + timedelta(days=1)).date()} or not left
    assert prune(kept, tmp_path, config(states=("delete", {"after_days": 99}))).rows == 0


def test_old_rows_that_came_late_stay(store, ended, tmp_path):
    store.append(day_of_robot(0, received_at=NOW - timedelta(days=2))).result(120)
    rules = config(states=("delete", {}), samples=("delete", {}))
    assert prune(store, tmp_path, rules).rows == 0


def test_a_deployment_that_lasts_is_not_touched(store, tmp_path):
    def begin(session):
        session.execute(
            update(Deployment).values(started_at=DAY - timedelta(days=1), ended_at=None)
        )

    store.change(begin).result(60)
    store.append(day_of_robot(0)).result(120)
    rules = config(**{key: ("delete", {}) for key in PRUNABLE})
    assert prune(store, tmp_path, rules).rows == 0


def test_what_somebody_flagged_is_not_touched(kept, tmp_path):
    def flag(session):
        session.add(
            ManualFlagRow(
                deployment_key=session.scalars(select(Deployment.key)).one(),
                series="depth_m",
                first_at=DAY,
                last_at=DAY,
                flag=3,
                reason="a fish",
                at=NOW,
                by="ann",
                withdrawn_at=None,
                withdrawn_by=None,
            )
        )

    kept.change(flag).result(60)
    rules = config(**{key: ("delete", {}) for key in PRUNABLE})
    assert prune(kept, tmp_path, rules).rows == 0


@pytest.mark.parametrize("kind", ["raw", "states", "samples", "readings"])
def test_what_was_moved_comes_back_as_it_was(kept, tmp_path, kind):
    model = PRUNABLE[kind].model
    sums = PRUNABLE[kind].rollup
    before, sums_before = rows(kept, model), rows(kept, sums) if sums else None
    result = prune(kept, tmp_path, config(**{kind: ("move", {})}))
    assert result.moved[kind] == len(before)
    assert result.files == 2
    assert rows(kept, model) == []
    for file in sorted((tmp_path / "archive").rglob("*.gz")):
        restore_file(kept, tmp_path, file, NOW)
    assert rows(kept, model) == before
    if sums:
        assert rows(kept, sums) == sums_before
    with kept.read() as session:
        assert session.scalars(select(PrunedDayRow)).all() == []


def test_a_robot_is_heard_after_its_samples_were_read_into_another_station(
    kept, tmp_path, prepared_database
):
    prune(kept, tmp_path, config(samples=("move", {})))
    shutil.copy(prepared_database, tmp_path / "other.sqlite3")
    other = Store.open(f"sqlite:///{tmp_path / 'other.sqlite3'}")
    try:
        for file in sorted((tmp_path / "archive").rglob("*.gz")):
            assert restore_file(other, tmp_path / "elsewhere", file, NOW) == 360
        before, sums = rows(other, SampleRow), rows(other, SampleRollup)
        other.append([*day_of_robot(0), *day_of_robot(1)]).result(120)
        assert (rows(other, SampleRow), rows(other, SampleRollup)) == (before, sums)
        assert len(rows(other, StateRow)) == 720
    finally:
        other.close()


def test_what_was_read_back_stays_for_a_while(kept, tmp_path):
    rules = config(states=("move", {}))
    prune(kept, tmp_path, rules)
    for file in (tmp_path / "archive").rglob("*.gz"):
        restore_file(kept, tmp_path, file, NOW)
    assert prune(kept, tmp_path, rules).rows == 0


def told(store):
    with store.read() as session:
        return [(one.kind, one.action, one.rows) for one in pruned_stretches(session, ROBOT)]


def files_of_a_day(store, folder, kind, more):
    """Move a day of a robot to a file, and rows that it gets thereafter to a second one."""
    rules = config(**{kind: ("move", {})})
    store.append(day_of_robot(0)).result(120)
    prune(store, folder, rules)
    store.append(more).result(120)
    prune(store, folder, rules, again=True)
    return sorted((folder / "archive").rglob("*.gz"), key=lambda file: file.stat().st_mtime_ns)


@pytest.mark.parametrize("kind", ["raw", "states"])
def test_one_of_two_files_of_a_day_brings_back_no_more_than_it_holds(store, ended, tmp_path, kind):
    later = [
        replace(
            value, **{PRUNABLE[kind].at: getattr(value, PRUNABLE[kind].at) + timedelta(hours=2)}
        )
        for value in day_of_robot(0, every_s=20.0)
        if isinstance(value, RawFrame if kind == "raw" else StateReport)
    ]
    first, second = files_of_a_day(store, tmp_path, kind, later)
    assert told(store) == [(kind, "move", 540)]
    restore_file(store, tmp_path, second, NOW)
    assert told(store) == [(kind, "move", 360)]
    restore_file(store, tmp_path, second, NOW)
    assert told(store) == [(kind, "move", 360)]
    restore_file(store, tmp_path, first, NOW)
    assert told(store) == []


def test_a_pass_beside_reading_back_takes_nothing_of_it(kept, tmp_path, monkeypatch):
    rules = config(states=("move", {}))
    before = rows(kept)
    prune(kept, tmp_path, rules)
    file = min((tmp_path / "archive").rglob("*.gz"))

    def rows_and_a_pass(file, header):
        for number, row in enumerate(read_rows(file, header)):
            if number == 0:
                prune(kept, tmp_path, rules)
            yield row
        prune(kept, tmp_path, rules)

    monkeypatch.setattr("server.storage.restoring.read_rows", rows_and_a_pass)
    monkeypatch.setattr("server.storage.restoring._ROWS_AT_ONCE", 100)
    assert restore_file(kept, tmp_path, file, NOW) == 360
    assert rows(kept) == before[:360]
    assert told(kept) == [("states", "move", 360)]


def test_a_damaged_file_is_not_read_back(kept, tmp_path):
    prune(kept, tmp_path, config(states=("move", {})))
    file = next((tmp_path / "archive").rglob("*.gz"))
    file.write_bytes(gzip.compress(gzip.decompress(file.read_bytes()).replace(b"0", b"1")))
    with pytest.raises(ArchiveError, match="SHA-256"):
        restore_file(kept, tmp_path, file, NOW)
    assert rows(kept) == []


class CutOffError(Exception):
    pass


def begin_a_pass(store, folder, rules, until):
    """Begin a pass that is cut off at its first step after there is a row in a table."""

    def go_on():
        if rows(store, until):
            raise CutOffError

    with pytest.raises(CutOffError):
        Pruner(store, folder, NOW, go_on).run(rules)


def test_a_file_that_is_gone_before_a_row_went_is_written_anew(kept, tmp_path):
    before, rules = rows(kept), config(states=("move", {}))
    begin_a_pass(kept, tmp_path, rules, ArchiveFileRow)
    (file,) = (tmp_path / "archive").rglob("*.gz")
    was = file.read_bytes()
    file.unlink()
    prune(kept, tmp_path, StorageConfig())
    assert rows(kept) == before
    prune(kept, tmp_path, rules)
    assert rows(kept) == []
    assert file.read_bytes() == was
    assert told(kept) == [("states", "move", 720)]


def test_a_damaged_file_that_rows_left_for_holds_up_nothing_else(kept, tmp_path):
    rules = config(states=("move", {}), readings=("delete", {}))
    begin_a_pass(kept, tmp_path, rules, PrunedDayRow)
    assert 0 < len(rows(kept)) < 720
    (file,) = (tmp_path / "archive").rglob("*.gz")
    was = file.read_bytes()
    file.write_bytes(was[:-9])
    with pytest.raises(ArchiveError, match=f"{file.name} is not what was written.*put it back"):
        prune(kept, tmp_path, rules)
    assert rows(kept) == rows(kept, ReadingRow) == []
    file.write_bytes(was)
    prune(kept, tmp_path, rules)
    with kept.read() as session:
        assert set(session.scalars(select(ArchiveFileRow.state))) == {"moved"}


def test_a_file_and_its_folders_are_on_the_disk_before_a_row_goes(kept, tmp_path, monkeypatch):
    synced: set[Path] = set()

    def note(descriptor, fsync=os.fsync):
        fsync(descriptor)
        synced.add(Path(f"/proc/self/fd/{descriptor}").resolve())

    monkeypatch.setattr(os, "fsync", note)
    begin_a_pass(kept, tmp_path, config(states=("move", {})), ArchiveFileRow)
    (file,) = (tmp_path / "archive").rglob("*.gz")
    assert {*file.relative_to(tmp_path).parents} == {
        path.relative_to(tmp_path) for path in synced if path.is_dir()
    }


def test_nothing_goes_into_a_file_that_the_disk_lost(kept, tmp_path, monkeypatch):
    def lose(descriptor, *_):
        place = Path(f"/proc/self/fd/{descriptor}").resolve()
        with place.open("r+b") as file:
            file.seek(place.stat().st_size // 2)
            file.write(b"\0" * 64)

    before = rows(kept)
    monkeypatch.setattr(os, "posix_fadvise", lose)
    with pytest.raises(ArchiveError, match=r"does not hold what was written.*stay in the database"):
        prune(kept, tmp_path, config(states=("move", {})))
    assert rows(kept) == before


def test_raw_bytes_of_a_held_robot_do_not_keep_those_of_another(kept, tmp_path):
    kept.change(lambda session: add_robot(session, robot_record("mini-2", 2))).result(60)
    raw = [one for one in day_of_robot(0) if isinstance(one, RawFrame)]
    kept.append([replace(one, robot=RobotId("mini-2")) for one in raw]).result(120)
    begin_a_pass(kept, tmp_path, config(raw=("move", {})), ArchiveFileRow)
    goes_on = update(Deployment).where(Deployment.robot_key == 1).values(ended_at=None)
    kept.change(lambda session: session.execute(goes_on)).result(60)
    prune(kept, tmp_path, StorageConfig())
    with kept.read() as session:
        assert set(session.scalars(select(RawFrameRow.robot_key))) == {1}


def test_charts_of_thinned_samples_have_the_same_extremes(kept, tmp_path):
    with kept.read() as session:
        before = history(session, ROBOT, "blue_light", max_points=50).value
    prune(kept, tmp_path, config(samples=("thin", {"period_s": 60})))
    with kept.read() as session:
        after = history(session, ROBOT, "blue_light", max_points=50).value
    assert (min(after), max(after)) == (min(before), max(before))
