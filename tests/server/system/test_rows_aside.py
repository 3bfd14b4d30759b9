"""Rows that are in no database are told until somebody has taken them away."""

import pytest

from db.bridge import REFUSED_NAME, TORN_NAME
from server.system import rows_aside
from server.system.rows_aside import CAUSE
from tests.server.conftest import open_station, until


@pytest.mark.parametrize("name", [REFUSED_NAME, TORN_NAME])
async def test_rows_beside_the_database_are_an_alarm_while_they_are_there(
    tmp_path, world, monkeypatch, name
):
    monkeypatch.setattr(rows_aside, "LOOK_PERIOD_S", 0.05)
    async with open_station(tmp_path, world) as station:
        alarms = station.foundation.alarms
        aside = station.foundation.settings.data_dir / name
        aside.write_text("rows")
        alarm = await until(lambda: alarms.standing(CAUSE, None))
        assert name in alarm.text
        aside.unlink()
        await until(lambda: alarms.standing(CAUSE, None) is None)
