"""``grace design`` against a station that runs."""

import asyncio
import json

import pytest

from tests.server.cli.test_cli import grace
from tests.server.conftest import GRACE
from tests.server.plan_file.public import plan, waypoint

HERE, EAST = (42.762, -84.377), (42.762, -84.376)


@pytest.fixture
def by_station(client, address, monkeypatch):
    """Run the verb beside the station that it asks."""
    monkeypatch.setenv("GRACE_TOKEN", client.headers["Authorization"].removeprefix("Bearer "))
    url = f"http://{address}"
    return lambda *words: asyncio.to_thread(grace, "design", *words, "--url", url)


async def test_a_plan_is_imported_and_written_again(by_station, client, tmp_path, capsys):
    file = tmp_path / "bay.plan"
    file.write_bytes(plan([waypoint(1, *HERE, -5), waypoint(2, *EAST, -5)], home=(*HERE, 0)))
    assert await by_station("import", GRACE, file, "--yes") == 0
    said = capsys.readouterr().out
    assert "2 waypoints over 81.9 m" in said
    assert "Planned home: 42.7620000, -84.3770000" in said
    added = said.splitlines()[-1]
    assert added.endswith("(bay).")
    design = added.split()[1]
    kept = (await client.get(f"/api/designs/{design}")).json()["document"]
    assert kept["manner"]["deep_m"] == 5.0
    again = tmp_path / "again.plan"
    assert await by_station("export", design, again) == 0
    assert "kept for this station alone: that a leg glides" in capsys.readouterr().out
    assert json.loads(again.read_text())["grace"]["design"] == kept
    assert await by_station("export", design, again) == 1
    assert "nothing was written" in capsys.readouterr().err
    assert await by_station("export", design, tmp_path / "a.doc") == 2


async def test_what_is_refused_is_told_and_nothing_is_kept_before_it_is_answered(
    by_station, client, tmp_path, capsys
):
    file = tmp_path / "drone.plan"
    file.write_bytes(plan([waypoint(1, *HERE, 5), waypoint(2, *EAST, -5)]))
    assert await by_station("import", GRACE, file, "--yes") == 1
    said = capsys.readouterr()
    assert "refused: item 1: 5 m: it is 5.0 m above the water" in said.out
    assert "(--turn-sign)" in said.out
    assert "first answer with --import-rest" in said.err
    assert await by_station("import", GRACE, file, "--import-rest") == 1
    assert "say --yes" in capsys.readouterr().err
    assert (await client.get(f"/api/robots/{GRACE}/designs")).json() == []
    broken = tmp_path / "broken.plan"
    broken.write_bytes(b"{")
    assert await by_station("import", GRACE, broken, "--yes") == 1
    assert "line 1" in capsys.readouterr().err


def test_a_station_must_be_named(capsys, tmp_path):
    assert grace("design", "export", "design-1", tmp_path / "a.kml") == 2
    assert "--url" in capsys.readouterr().err
