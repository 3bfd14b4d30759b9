"""A plan reckons with the current as well as the robot says that it knows it."""

from dataclasses import replace
from datetime import timedelta
from types import SimpleNamespace

import pytest

from autonomy.estimation.known_current import UNTOLD
from autonomy.planner.preset import planner_preset
from db.query.fleet.onboard import ParameterRecord, keep_parameters
from server.plan.settings import with_told_fix_depth
from tests.server.conftest import MINI
from tests.server.fake_link import current_report

PRESET = planner_preset("miniglider", "tank")


def planned(station, report):
    station.fleet.take_current(report)
    return station.planning.settings.known_current(MINI, PRESET).position_filter


def test_what_the_robot_knows_of_the_current_and_doubts_counts(station):
    now = station.foundation.clock.now() + timedelta(seconds=1)
    told = replace(current_report(MINI, now), current_std_m_s=0.006, doubt=1.5)
    position = planned(station, told)
    assert position.steady_current_m_s == pytest.approx(0.004, abs=1e-4)
    assert position.doubt == 1.5


def test_a_robot_that_never_told_is_taken_for_one_just_switched_on(station, monkeypatch):
    """Its filter begins with more than is usual, for how strong a current is here is a guess."""
    silent = SimpleNamespace(current_report=None)
    monkeypatch.setattr(station.fleet, "status", lambda _: silent)
    position = station.planning.settings.known_current(MINI, PRESET).position_filter
    assert position.steady_current_m_s == pytest.approx(UNTOLD * 0.01)
    assert position.usual_current_m_s == pytest.approx(0.01)


async def test_plans_count_on_fixes_as_deep_as_the_robot_said_that_it_takes_them(station):
    store = station.foundation.store
    now = station.foundation.clock.now()
    assert await with_told_fix_depth(store, MINI, PRESET) == (PRESET, "")
    deep = {"surface_depth_m": 1.2}
    position = PRESET.position_filter.model_copy(update=deep)
    wished = PRESET.model_copy(update={"position_filter": position})
    told = ParameterRecord("FIX_DEPTH_M", 0.05000000074505806, "real32", now)
    await store.write(lambda session: keep_parameters(session, MINI, [told]))
    assert await with_told_fix_depth(store, MINI, PRESET) == (PRESET, "")
    planned = await station.planning.in_water(MINI, wished)
    assert planned.config.position_filter.surface_depth_m == 0.05
    assert planned.text == (
        "Fixes count to a depth of 0.05 m, as mini-1 said by FIX_DEPTH_M; the settings say 1.2 m."
    )


def test_settings_that_a_plan_was_made_with_still_say_what_is_usual(station):
    now = station.foundation.clock.now() + timedelta(seconds=1)
    station.fleet.take_current(replace(current_report(MINI, now), current_std_m_s=0.004))
    known = station.planning.settings.known_current
    once = known(MINI, PRESET)
    assert known(MINI, once).position_filter.usual_current_m_s == pytest.approx(0.01)


def test_what_it_knew_grows_old_towards_what_the_water_may_be(station, monkeypatch):
    now = station.foundation.clock.now() + timedelta(seconds=1)
    told = current_report(MINI, now)
    monkeypatch.setattr(station.fleet, "age_s", lambda _: 1e9)
    assert planned(station, told).steady_current_m_s == pytest.approx(0.01)
