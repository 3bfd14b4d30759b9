"""The station's map of a current: from dives to a status, a restart and settings."""

import asyncio
import math
import re
import shutil
from dataclasses import replace
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest

from autonomy.current.config import CurrentMapConfig
from autonomy.current.model import CurrentMap, Taking
from autonomy.estimation.config import estimator_preset
from db.fault import StoreError
from db.query.station.events import newest_events
from robot_link.messages import RobotId, RobotMode, StateReport
from robot_link.report import CurrentReport
from server.current import currents as module
from server.current.currents import Currents
from server.current.observing import Stay, dives_seen
from server.current.record import Forecast, KeptObservation, verdict_on
from server.current.water_current import WaterCurrent
from server.current.words import left_out_text, tide_text, worth_of, worth_text
from server.fleet.fleet import Fleet
from server.fleet.water import Water
from tests.autonomy.test_current_map import TIDAL, observation
from tests.server.conftest import GRACE, MINI, open_station, until
from tests.server.fake_link import state_report

DIVE_S = 300.0
CURRENT = (0.06, -0.03)
BELIEVED = (0.02, 0.01)


@pytest.fixture(autouse=True)
def _short_pauses(monkeypatch):
    monkeypatch.setattr(module, "GATHER_S", 0.05)


def believed_report(robot: RobotId, at: datetime, current=BELIEVED) -> CurrentReport:
    return CurrentReport(
        robot=robot,
        measured_at=at,
        received_at=at,
        current_ne_m_s=current,
        current_std_m_s=0.01,
        doubt=1.0,
        dives=3,
        fixes_refused=0,
    )


def lake_dive(
    begin: datetime,
    north_m: float = 150.0,
    *,
    robot: RobotId = GRACE,
    current: tuple[float, float] = CURRENT,
    believed: tuple[float, float] = BELIEVED,
    mode: RobotMode = RobotMode.SURFACED,
) -> list[StateReport]:
    """Return what a robot says that goes north at 0.1 m/s and reckons with a wrong current."""
    told = [state_report(robot, (north_m, 200.0, 0.0), at=begin, position_std_m=1.5, mode=mode)]
    steps = 30
    for i in range(1, steps + 1):
        t = DIVE_S * i / steps
        place = (
            north_m + (0.1 + believed[0]) * t,
            200.0 + believed[1] * t,
            10.0 * math.sin(math.pi * i / (steps + 1)),
        )
        told.append(
            state_report(
                robot,
                place,
                at=begin + timedelta(seconds=t),
                position_std_m=math.hypot(1.5, 0.3 * math.sqrt(t) + 0.02 * t),
                has_fix=False,
                mode=RobotMode.GLIDING,
            )
        )
    end_s = DIVE_S + 2.0
    found = (north_m + (0.1 + current[0]) * end_s, 200.0 + current[1] * end_s, 0.0)
    after = begin + timedelta(seconds=end_s)
    told.append(state_report(robot, found, at=after, position_std_m=1.5, mode=mode))
    return told


async def say(station, world, begin: datetime, **how) -> None:
    """Let grace-1 tell of one dive, and of what it had believed of the current."""
    said = believed_report(GRACE, begin - timedelta(seconds=1))
    await asyncio.wrap_future(station.foundation.store.append([said]))
    for one in lake_dive(begin, **how):
        world.tell(one)


async def fly(station, world, count: int, first: int = 0, **how) -> None:
    """Let grace-1 tell of some of twelve dives, one each ten minutes until now."""
    now = datetime.now(UTC)
    currents = station.foundation.services.get(Currents)
    for i in range(first, first + count):
        before = len(currents.of(GRACE).dives)
        begin = now - timedelta(seconds=600.0 * (12 - i))
        await say(station, world, begin, north_m=120.0 + 20.0 * i, **how)
        await until(lambda before=before: len(currents.of(GRACE).dives) > before)


async def test_dives_make_a_map_that_a_restart_finds_again(tmp_path, world, prepared_database):
    shutil.copy(prepared_database, tmp_path)
    there = np.array([[200.0, 200.0, 5.0, datetime.now(UTC).timestamp()]])
    async with open_station(tmp_path, world) as station:
        currents = station.foundation.services.get(Currents)
        assert currents.usable(GRACE) is None
        await fly(station, world, 7)
        known = currents.usable(GRACE)
        assert known is not None
        flow = known.flow(there)
        np.testing.assert_allclose(flow.mean_ne_m_s[0], CURRENT, atol=0.012)
        found = currents.of(GRACE)
        assert len(found.verdicts) == 6
        assert currents.usable(MINI) is None
        await until(lambda: currents.of(GRACE).known.learned)
        flow = currents.of(GRACE).known.flow(there)
        verdicts = list(currents.of(GRACE).verdicts)
    async with open_station(tmp_path, world) as station:
        currents = station.foundation.services.get(Currents)
        again = currents.of(GRACE)
        assert len(again.dives) == 7
        assert list(again.verdicts) == verdicts
        same = again.known.flow(there)
        np.testing.assert_allclose(same.mean_ne_m_s, flow.mean_ne_m_s, atol=1e-12)
        np.testing.assert_allclose(same.cov_m2_s2, flow.cov_m2_s2, atol=1e-15)
        assert again.known.learned is not None
        assert not again.is_learning_due


async def test_status_flow_and_files_say_what_the_dives_told(client, station, world):
    empty = (await client.get("/api/robots/grace-1/current")).json()
    assert empty["dives"] == 0
    assert empty["text"] == "No dive has told of the current yet."
    assert (await client.get("/api/robots/grace-1/current/flow")).json()["arrows"] == []
    refused = await client.get("/api/robots/grace-1/current/flow?format=csv")
    assert refused.status_code == 409
    await fly(station, world, 5)
    told = (await client.get("/api/robots/grace-1/current")).json()
    assert told["dives"] == 5
    assert told["oldest_at"] < told["newest_at"]
    assert told["is_usable"]
    assert re.match(
        r"From 5 dives of grace-1\. At grace-1 now [567]\.\d cm/s to 3[23]\d°, give or take \d",
        told["text"],
    )
    assert told["worth"].startswith("The last four surfacings were ")
    assert told["error_m"] < 4.0
    flow = (await client.get("/api/robots/grace-1/current/flow")).json()
    assert not flow["is_predicted"]
    near = min(
        flow["arrows"], key=lambda one: math.hypot(one["north_m"] - 200, one["east_m"] - 200)
    )
    assert near["is_told"]
    assert near["is_sure"]
    assert near["velocity_ne_m_s"] == pytest.approx(CURRENT, abs=0.015)
    assert near["ellipse_m_s"][0] >= near["ellipse_m_s"][1] > 0.0
    later = (datetime.now(UTC) + timedelta(hours=3)).isoformat()
    ahead = await client.get("/api/robots/grace-1/current/flow", params={"at": later})
    assert ahead.json()["is_predicted"]
    where = {"north_m": 200.0, "east_m": 200.0, "depth_m": 5.0}
    here = (await client.get("/api/robots/grace-1/current/at", params=where)).json()
    assert here["velocity_ne_m_s"] == pytest.approx(CURRENT, abs=0.015)
    assert 0.0 < here["std_ne_m_s"][0] < 0.03
    typed = {"north_m_s": CURRENT[0], "east_m_s": CURRENT[1]}
    worth = (await client.get("/api/robots/grace-1/current/worth", params=typed)).json()
    assert worth["is_map_usable"]
    assert re.match(r"It carried the last five dives 20 m \(rms\) off\.", worth["none"])
    assert re.match(r"By it the last five dives would have come up [0-2]", worth["typed"])
    assert worth["map"].startswith("5 dives, the newest ")
    file = await client.get("/api/robots/grace-1/current/flow?format=csv")
    assert file.text.startswith("# SIMULATION")
    assert "eastward_sea_water_velocity [m/s]" in file.text
    assert "_SIMULATION.csv" in file.headers["content-disposition"]


async def test_typed_settings_make_the_map_anew_and_strange_dives_are_told(client, station, world):
    await fly(station, world, 4)
    currents = station.foundation.services.get(Currents)
    before = currents.of(GRACE).known.prior_std_m_s()
    answer = await client.patch(
        "/api/config/current_map?robot=grace-1", json={"basin_std_m_s": 0.3}
    )
    assert answer.status_code == 200, answer.text
    await until(lambda: currents.of(GRACE).known.prior_std_m_s() > 2.0 * before)
    assert len(currents.of(GRACE).dives) == 4
    await client.patch(
        "/api/config/current_map?robot=grace-1", json={"enabled": None, "basin_std_m_s": None}
    )
    await until(lambda: currents.of(GRACE).known.prior_std_m_s() == before)
    await fly(station, world, 1, first=4, current=(-0.5, 0.4))
    events = await station.foundation.store.query(newest_events)
    assert any(one.kind == "current.dive_doubted" for one in events)


async def test_a_water_that_is_not_mapped_takes_no_dives_until_it_is(client, station, world):
    currents = station.foundation.services.get(Currents)
    await client.patch("/api/config/current_map?robot=grace-1", json={"enabled": False})
    await until(lambda: not currents.of(GRACE).config.enabled)
    begin = datetime.now(UTC) - timedelta(seconds=3000)
    await say(station, world, begin)
    await currents.look(GRACE)
    assert currents.of(GRACE).dives == ()
    told = (await client.get("/api/robots/grace-1/current")).json()
    assert told["text"].startswith("The current of this water is not mapped")
    assert currents.usable(GRACE) is None
    where = {"north_m": 200.0, "east_m": 200.0}
    at = await client.get("/api/robots/grace-1/current/at", params=where)
    assert at.status_code == 409
    assert "not mapped" in at.json()["detail"]
    await client.patch("/api/config/current_map?robot=grace-1", json={"enabled": True})
    await until(lambda: len(currents.of(GRACE).dives) == 1)


async def test_what_could_not_be_kept_is_looked_at_again(station, world, monkeypatch):
    currents = station.foundation.services.get(Currents)
    right, failures = currents._keep, []

    async def fails_once(*args):
        if not failures:
            failures.append(1)
            raise StoreError("the disk is full")
        await right(*args)

    monkeypatch.setattr(currents, "_keep", fails_once)
    await say(station, world, datetime.now(UTC) - timedelta(seconds=3000))
    await until(lambda: len(currents.of(GRACE).dives) == 1)
    assert failures


async def test_a_robot_that_works_elsewhere_brings_no_current_along(client, station, world):
    currents = station.foundation.services.get(Currents)
    await fly(station, world, 3)
    site = (await client.get("/api/robots/grace-1")).json()["site"]
    other = {**site, "name": "Another lake"}
    answer = await client.patch("/api/robots/grace-1", json={"site": other})
    assert answer.status_code == 200, answer.text
    await until(lambda: currents.of(GRACE).water.name == "Another lake")
    assert currents.of(GRACE).dives == ()
    assert station.foundation.services.get(Fleet).status(GRACE).current_report is None
    await client.patch("/api/robots/grace-1", json={"site": site})
    await until(lambda: currents.of(GRACE).water.name == site["name"])
    assert len(currents.of(GRACE).dives) == 3


def test_a_row_of_another_shape_is_read_without_its_prediction():
    dive = observation(1000.0, (12.0, 0.0))
    row = KeptObservation(dive, Forecast(900.0, 2500.0, 3, 0.02, 0.0, 0.05, 0.0), None).record("x")
    old = replace(row, document={**row.document, "forecast": {"made_s": 900.0}})
    assert KeptObservation.of(row).forecast is not None
    assert KeptObservation.of(old).forecast is None
    assert KeptObservation.of(old).observation.key == dive.key


def test_impossible_dive_is_refused_and_a_repeated_one_ignored():
    water = Water("Practice lake", 42.76, -84.38, "simulated")
    empty = WaterCurrent(water, (GRACE,), CurrentMapConfig(), CurrentMap(CurrentMapConfig()))
    good = observation(0.0, robot=GRACE)
    grown, taken = empty.with_observations([good, good, observation(900.0, (1300.0, 0.0))])
    assert [one.observation.key for one in taken.kept] == [good.key]
    ((_, appended),) = taken.told
    assert appended.taking is Taking.REFUSED
    assert "no current is faster than 3 m/s" in appended.text
    assert empty.dives == ()
    assert grown.new == 1


def columns_of(told):
    """Return reports as the database gives them."""
    from db.query.measured.smoothing import TrackColumns

    count = len(told)
    return TrackColumns(
        measured_at_us=np.array([round(one.measured_at.timestamp() * 1e6) for one in told]),
        position_ned=np.array([one.position_ned for one in told]),
        position_std_m=np.array([one.position_std_m for one in told]),
        has_fix=np.array([one.has_fix for one in told]),
        log=np.full(count, -1),
        sequence=np.zeros(count, dtype=np.int64),
    )


def fixes_of(told):
    from db.query.measured.current_observations import ReportedFix

    return [
        ReportedFix(
            one.measured_at,
            one.position_ned[0],
            one.position_ned[1],
            one.position_std_m,
            one.has_fix,
            one.mode,
        )
        for one in told
    ]


def seen(told, reports, *, silently=True):
    return dives_seen(
        GRACE,
        columns_of(told),
        fixes_of(told),
        np.array(
            [
                (one.measured_at.timestamp(), *one.current_ne_m_s, one.current_std_m_s)
                for one in reports
            ]
        ).reshape(-1, 4),
        drift_m_sqrt_s=0.3,
        subtracts_silently=silently,
    )


BEGIN = datetime(2026, 5, 1, tzinfo=UTC)


def test_raw_drift_is_that_without_the_current_that_the_robot_reckoned_with():
    (dive,) = seen(lake_dive(BEGIN), [believed_report(GRACE, BEGIN)]).observations
    np.testing.assert_allclose(dive.current_ne_m_s, CURRENT, atol=1e-6)
    assert dive.duration_s == pytest.approx(302.0)
    assert dive.walk_std_m == pytest.approx(math.hypot(1.5, 0.3 * math.sqrt(302.0)), rel=1e-6)
    np.testing.assert_allclose(dive.position_ned[0, :2], (150.0, 200.0))
    np.testing.assert_allclose(dive.position_ned[-1, :2], (150.0 + 30.2, 200.0), atol=1e-6)
    assert len(dive.time_s) <= 31


def test_dives_that_tell_nothing_are_left_out_and_said():
    silent = seen(lake_dive(BEGIN), [])
    assert silent.observations == ()
    assert silent.left_out == ("it reckons with a current that it does not report",)
    told = left_out_text({"grace-1": silent.left_out[0]})
    assert told.startswith("The newest dive of grace-1 is left out: it reckons")
    plain = seen(lake_dive(BEGIN, believed=(0.0, 0.0)), [], silently=False)
    np.testing.assert_allclose(plain.observations[0].current_ne_m_s, CURRENT, atol=1e-6)
    long_ago = believed_report(GRACE, BEGIN - timedelta(hours=3))
    assert seen(lake_dive(BEGIN), [long_ago]).left_out == silent.left_out
    held = seen(lake_dive(BEGIN, mode=RobotMode.HOLDING), [believed_report(GRACE, BEGIN)])
    assert held.observations == ()
    assert held.left_out == ("it ended aborted or held",)


def test_stay_at_the_surface_is_told_once_it_is_over():
    lake = estimator_preset("grace3", "lake")

    def reports(begin_s, end_s, mode=RobotMode.IDLE):
        return fixes_of(
            state_report(
                GRACE,
                (0.05 * t, 0.0, 0.0),
                at=BEGIN + timedelta(seconds=t),
                position_std_m=0.4,
                mode=mode,
            )
            for t in range(begin_s, end_s, 5)
        )

    stay, told = Stay().with_reports(GRACE, reports(0, 50), lake)
    assert told == ()
    stay, told = stay.with_reports(GRACE, reports(50, 185), lake)
    assert told == ()
    stay, (told,) = stay.with_reports(GRACE, reports(185, 190, RobotMode.DIVING), lake)
    assert told.is_surface
    assert told.duration_s == 180.0
    assert told.displacement_ne_m == pytest.approx((9.0, 0.0))
    assert told.walk_std_m == pytest.approx(0.3 * math.sqrt(180.0))
    short = reports(200, 240) + reports(240, 245, RobotMode.TURNING)
    stay, told = stay.with_reports(GRACE, short, lake)
    assert (stay, told) == (Stay(), ())


def test_eddies_of_a_stay_are_not_taken_for_the_current():
    lake = estimator_preset("grace3", "lake")
    minutes = fixes_of(
        state_report(
            GRACE, (0.0, 0.03 * t, 0.0), at=BEGIN + timedelta(seconds=t), position_std_m=0.4
        )
        for t in range(0, 125, 5)
    )
    after = fixes_of(
        [state_report(GRACE, at=BEGIN + timedelta(seconds=130), mode=RobotMode.DIVING)]
    )
    _, told = Stay().with_reports(GRACE, minutes + after, lake)
    assert told == ()
    calm = lake.model_copy(update={"drift_m_sqrt_s": 0.02})
    _, told = Stay().with_reports(GRACE, minutes + after, calm)
    assert len(told) == 1


def test_prediction_counts_only_if_it_was_made_before_the_dive():
    dive = observation(1000.0, (12.0, 0.0))
    said = Forecast(900.0, 2500.0, 3, 0.02, 0.0, 0.05, 0.0)
    verdict = verdict_on(said, dive)
    assert verdict.error_m == pytest.approx(4.0)
    assert verdict.last_error_m == pytest.approx(8.0)
    assert verdict_on(None, dive) is None
    assert verdict_on(replace(said, made_s=1100.0), dive) is None
    assert verdict_on(replace(said, until_s=950.0), dive) is None
    assert worth_text([verdict] * 2) == ""
    assert worth_text([verdict] * 10) == (
        "The last ten surfacings were 4 m from the prediction; by the last current they would "
        "have been 8 m."
    )


def test_each_choice_of_a_current_says_what_it_is_worth():
    water = Water("Practice lake", 42.76, -84.38, "simulated")
    empty = WaterCurrent(water, (GRACE,), CurrentMapConfig(), CurrentMap(CurrentMapConfig()))
    nothing = worth_of(empty, (0.02, 0.0), 0.0)
    assert nothing.none == nothing.typed == "No dive has told yet how the water moves."
    assert nothing.map == "No dive has told of the current yet. The typed current holds."
    dives = [observation(900.0 * i, (30.0, -40.0), robot=GRACE) for i in range(5)]
    few, _ = empty.with_observations(dives[:2])
    said = worth_of(few, (0.1, 0.0), 3000.0)
    assert said.map == (
        "2 dives, the newest 28 min ago. For a plan it takes 3 of them: until then the typed "
        "current holds."
    )
    grown, _ = empty.with_observations(dives)
    said = worth_of(grown, (0.075, -0.1), 3600.0 * 4)
    assert said.none == "It carried the last five dives 50 m (rms) off."
    assert said.typed == "By it the last five dives would have come up 0 m (rms) off."
    assert re.fullmatch(
        r"5 dives, the newest 3 h ago\. One like the newest would come up within \d+ m "
        r"\(9 of 10\); the last four were [\d.]+ m \(rms\) off\.",
        said.map,
    )
    old = worth_of(grown, (0.0, 0.0), 86_400.0 * 30)
    assert "the newest 30 days ago. For a plan that is too long ago" in old.map


def test_tide_is_told_with_its_next_slack():
    known = CurrentMap(TIDAL)
    period_s = 3600.0 * 12.4206
    for i in range(24):
        start_s = 3000.0 * i
        way = 2400.0 * 0.3 * math.cos(2.0 * math.pi * (start_s + 1200.0) / period_s)
        known.append(observation(start_s, (way, 0.0), duration_s=2400.0, way_m=800.0))
    text = tide_text(known, (0.0, 0.0, 0.0), 2.0 * period_s)
    assert text.startswith(("Tide up to 2", "Tide up to 3"))
    assert "next slack" in text
