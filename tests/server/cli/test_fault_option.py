"""``--fault``: what is refused before anything starts, and the event that a fault leaves."""

from argparse import Namespace
from datetime import UTC, datetime

import pytest

from db.query.fleet.robots import RobotRecord, add_robot
from db.query.station.events import EventFilter, newest_events
from server.cli import simulate_verb
from server.cli.data import open_store, settings_of
from simulator.fault_desk import FaultNews
from simulator.fleet import MINI_1
from tests.server.cli.test_cli import grace

AT = datetime(2026, 11, 23, 12, 0, tzinfo=UTC)
SENTENCE = "Caused in the simulator: water gets into the hull (mini-1, leak)."
OVER = "Mended in the simulator: the hull is dry and tight (mini-1, leak)."


def record():
    return RobotRecord(
        id=MINI_1.robot,
        name=MINI_1.robot,
        model=MINI_1.vehicle.key,
        kind="simulated",
        system_id=MINI_1.system_id,
        links=(),
        site=MINI_1.site,
        created_at=AT,
    )


@pytest.mark.parametrize("verb", ["demo", "simulate"])
@pytest.mark.parametrize(
    ("fault", "sentence"),
    [
        ("hole@60", "there is no fault 'hole'; there are leak, pump"),
        ("leak@never", "leak@SECONDS"),
        ("mini-9:leak@60", "no robot mini-9 for the fault leak; there are mini-1, grace-1"),
        ("mini-1:optode@60", "mini-1 has no fault optode; there are leak, pump, sensor"),
    ],
)
def test_a_fault_that_cannot_be_caused_ends_the_verb_with_a_sentence(
    verb, fault, sentence, tmp_path, capsys
):
    try:
        status = grace(verb, "--fault", fault, "--data", tmp_path / "data")
    except SystemExit as end:
        status = end.code
    assert status == 2
    assert sentence in capsys.readouterr().err


def test_a_caused_fault_is_an_event_of_its_robot(tmp_path):
    folder = tmp_path / "data"
    with open_store(settings_of(Namespace(data=folder))) as store:
        store.change(lambda session: add_robot(session, record())).result()
        simulate_verb.note_fault(folder, AT, FaultNews(MINI_1.robot, SENTENCE))
        simulate_verb.note_fault(folder, AT, FaultNews(MINI_1.robot, OVER, is_over=True))
        with store.read() as session:
            event, over = newest_events(session, EventFilter(robot="mini-1"))
    assert (event.kind, event.level, event.text) == ("fault.caused", "warning", SENTENCE)
    assert event.at == AT
    assert (over.kind, over.level, over.text) == ("fault.mended", "info", OVER)


def test_a_fault_of_a_robot_that_no_station_knows_is_only_logged(tmp_path, caplog):
    simulate_verb.note_fault(tmp_path / "data", AT, FaultNews(MINI_1.robot, SENTENCE))
    assert SENTENCE in caplog.text
    assert "not in the event log" in caplog.text
