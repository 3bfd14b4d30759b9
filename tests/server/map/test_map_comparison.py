import asyncio
import io
import threading
from dataclasses import replace
from datetime import timedelta
from types import SimpleNamespace

import numpy as np
import pytest

from autonomy.field.config import FIELD_PRESETS
from autonomy.field.samples import FieldSamples
from autonomy.field.synthetic import measure
from autonomy.site import TANK
from db.query.fleet.robots import add_robot
from db.query.measured.samples import sample_columns
from robot_link.messages import RobotId, Sample
from server.map import comparison_task as compare_maps
from server.map import field_maps
from server.map.comparison import _problem
from server.map.comparison_task import held_out_parts
from server.map.field_model import MODEL_TITLES, MODELS
from server.map.samples import field_samples
from server.map.task import PLACED_BY_CAMERAS, ComparisonProblem
from tests.autonomy.test_field_carriage import Steady
from tests.server.conftest import MINI, open_station, robot_record, until
from tests.server.dive import begin_of, dive

LIVE = FIELD_PRESETS["blue_light"].model
OTHER = next(model for model in MODELS if model != LIVE)
PATH = "/api/robots/mini-1/maps/blue_light"
SCORES = ("rmse", "nlpd", "wmse", "coverage")


def surveyed(count=80, dives=4, seed=2):
    """Return samples of a survey that knows its position well."""
    rng = np.random.default_rng(seed)
    domain = TANK.domain
    points = rng.random((count, 3)) * [domain.x_max_m, domain.y_max_m, domain.depth_max_m]
    std_m = np.tile(np.linspace(0.01, 0.08, count // dives), dives)
    return FieldSamples.of(points, measure("blue_light", points, rng), std_m)


def problem(samples=None, **changes):
    asked = ComparisonProblem(
        FIELD_PRESETS["blue_light"],
        TANK.domain,
        TANK,
        surveyed() if samples is None else samples,
        is_simulated=True,
    )
    return replace(asked, **changes)


def never():
    return False


@pytest.fixture(autouse=True)
def _unsmoothed(monkeypatch):
    """Leave the map what it is after its samples: a smoothed dive makes a comparison outdated."""
    for name in ("QUIET_S", "QUIET_LIMIT_S"):
        monkeypatch.setattr(field_maps, name, 1e6)


async def sampled(station, world, robot=MINI):
    for number in range(2):
        begin = begin_of(3) + timedelta(seconds=100 * number)
        for one in dive(robot, begin, first=20 * number, north_m=0.4 + 0.5 * number):
            if isinstance(one, Sample):
                world.tell(one)

    def there():
        view = station.maps.views(robot).get(("blue_light", LIVE))
        return view is not None and sum(view.samples_per_level) == 40

    await until(there)


async def compared(client, path=PATH):
    started = await client.post(f"{path}/comparison")
    assert started.status_code == 202, started.text

    async def ready():
        job = (await client.get(f"/api/jobs/{started.json()['id']}")).json()
        return job if job["state"] not in {"queued", "running"} else None

    job = await until(ready)
    return job, (await client.get(f"{path}/comparison")).json()


def test_simulated_survey_is_scored_against_the_truth_by_every_model():
    told = []
    found = compare_maps.run(problem(), told.append, never)
    assert (found.against, found.message) == ("truth", "")
    assert [one.model for one in found.models] == list(MODELS)
    for one in found.models:
        assert 0.0 < one.scores.rmse < 1.0
        assert np.isfinite(one.log_marginal_likelihood)
        assert one.mean.shape == one.std.shape
    assert [message for _, message in told] == list(MODEL_TITLES.values())
    few = compare_maps.run(problem(surveyed(12, 4)), print, never)
    for more, less in zip(found.models, few.models, strict=True):
        assert more.scores.rmse < less.scores.rmse


def test_real_survey_is_scored_against_dives_that_are_held_out():
    found = compare_maps.run(problem(is_simulated=False, with_maps=False), print, never)
    assert found.against == "held-out samples"
    for one in found.models:
        assert one.mean is None
        assert 0.0 < one.scores.rmse < 1.5
        assert 0.5 < one.scores.coverage_90 <= 1.0


def test_a_survey_that_cameras_saw_is_scored_where_they_saw_it():
    true = surveyed()
    lost = replace(true, points=true.points + np.array([0.7, 0.4, 0.0]))
    asked = problem(lost, is_simulated=False, with_maps=False)
    by_itself = compare_maps.run(asked, print, never)
    by_cameras = compare_maps.run(replace(asked, places_seen=true.points), print, never)
    assert by_itself.against == "held-out samples"
    assert by_cameras.against == PLACED_BY_CAMERAS
    for own, seen in zip(by_itself.models, by_cameras.models, strict=True):
        assert seen.scores.rmse > own.scores.rmse, "the map is as wrong as the robot was lost"


def test_samples_that_no_camera_saw_are_not_scored_by_cameras():
    samples = surveyed()
    seen = np.where((samples.dive < 2)[:, None], samples.points, np.nan)
    asked = problem(samples, is_simulated=False, with_maps=False)
    found = compare_maps.run(replace(asked, places_seen=seen), print, never)
    assert found.against == PLACED_BY_CAMERAS
    only_one = np.where((samples.dive < 1)[:, None], samples.points, np.nan)
    found = compare_maps.run(replace(asked, places_seen=only_one), print, never)
    assert found.against == "held-out samples", "one dive alone cannot be held apart"


def test_dive_is_held_out_whole_and_every_dive_once():
    samples = surveyed(60, 6)
    parts = held_out_parts(samples)
    assert np.sum(parts, axis=0).tolist() == [1] * 60
    for part in parts:
        assert not np.isin(samples.dive[part], samples.dive[~part]).any()


def test_one_dive_is_mapped_but_not_scored_and_that_is_said():
    found = compare_maps.run(problem(surveyed(20, 1), is_simulated=False), print, never)
    assert found.against is None
    assert "one dive only" in found.message
    assert [one.scores for one in found.models] == [None] * 4
    assert all(np.isfinite(one.mean).all() for one in found.models)


def test_model_that_cannot_use_the_kernel_is_left_out_and_that_is_said():
    field = FIELD_PRESETS["blue_light"]
    rough = field.single.model_copy(update={"shape": "matern12"})
    found = compare_maps.run(
        problem(field=field.model_copy(update={"single": rough})), print, never
    )
    assert [one.model for one in found.models] == ["single", "recursive", "joint"]
    assert MODEL_TITLES["position_noise"] in found.message
    assert "smoother" in found.message


def test_comparison_that_is_called_off_ends_early():
    seen = []

    def after_the_first():
        return bool(seen)

    found = compare_maps.run(problem(), seen.append, after_the_first)
    assert len(found.models) == 1


async def test_four_models_are_compared_on_the_same_samples(client, station, world, in_threads):
    await until(lambda: station.maps.group(MINI))
    before = (await client.get(f"{PATH}/comparison")).json()
    assert (before["state"], before["models"]) == ("none", [])
    assert (await client.post(f"{PATH}/comparison")).status_code == 409
    assert (await client.get(f"{PATH}?model={OTHER}")).status_code == 404
    await sampled(station, world)
    job, found = await compared(client)
    assert job["state"] == "done"
    assert (found["state"], found["samples"], found["against"]) == ("ready", 40, "truth")
    assert [one["model"] for one in found["models"]] == list(MODELS)
    assert [one["model"] for one in found["models"] if one["is_default"]] == [LIVE]
    for one in found["models"]:
        assert all(np.isfinite(one[name]) for name in SCORES)
        assert one["title"] == MODEL_TITLES[one["model"]]
    assert not found["is_outdated"]
    live = (await client.get(PATH)).json()
    assert live["models"][0] == LIVE
    assert set(live["models"]) == set(MODELS)
    shown = (await client.get(f"{PATH}?model={OTHER}")).json()
    assert shown["model"] == OTHER
    assert len(shown["mean"]) == len(live["mean"])
    archive = await client.get(f"{PATH}?model={OTHER}&format=npz")
    with np.load(io.BytesIO(archive.content)) as arrays:
        assert str(arrays["model"]) == OTHER


async def test_comparison_outlives_a_restart_and_says_when_it_is_outdated(
    tmp_path, world, in_threads
):
    async with open_station(tmp_path, world) as station:
        await sampled(station, world)
        job = await station.comparisons.start(MINI, "blue_light", by="test")
        await until(lambda: station.comparisons.view(MINI, "blue_light").state == "ready")
        assert (await station.foundation.jobs.get(job)).state in {"running", "done"}
        before = station.maps.views(MINI)["blue_light", OTHER]
    async with open_station(tmp_path, world) as station:
        await until(lambda: ("blue_light", OTHER) in station.maps.views(MINI))
        after = station.maps.views(MINI)["blue_light", OTHER]
        np.testing.assert_allclose(after.mean, before.mean, atol=1e-5)
        assert not station.comparisons.view(MINI, "blue_light").is_outdated
        world.robots[MINI].sequence = 40
        world.robots[MINI].sample((1.0, 0.5, 0.2))
        await until(lambda: station.comparisons.view(MINI, "blue_light").is_outdated)


async def test_two_who_compare_at_once_get_the_same_job(
    client, station, world, in_threads, monkeypatch
):
    await sampled(station, world)
    asked, run = threading.Event(), compare_maps.run

    def held(*told):
        asked.wait()
        return run(*told)

    monkeypatch.setattr(compare_maps, "run", held)
    try:
        answers = await asyncio.gather(*(client.post(f"{PATH}/comparison") for _ in range(3)))
        assert len({answer.json()["id"] for answer in answers}) == 1
        assert len(station.foundation.jobs.running) == 1
    finally:
        asked.set()


async def test_comparison_that_is_cancelled_leaves_the_one_before(
    client, station, world, in_threads, monkeypatch
):
    await sampled(station, world)
    _, before = await compared(client)
    began = asyncio.Event()
    loop = asyncio.get_running_loop()
    run = compare_maps.run

    def slow(asked, report, is_cancelled):
        loop.call_soon_threadsafe(began.set)
        while not is_cancelled():
            pass
        return run(asked, report, is_cancelled)

    monkeypatch.setattr(compare_maps, "run", slow)
    job = (await client.post(f"{PATH}/comparison")).json()["id"]
    assert (await client.post(f"{PATH}/comparison")).json()["id"] == job
    await began.wait()
    working = (await client.get(f"{PATH}/comparison")).json()
    assert (working["state"], working["job"]) == ("working", job)
    assert working["models"] == before["models"]
    await client.delete(f"/api/jobs/{job}")
    after = (await client.get(f"{PATH}/comparison")).json()
    assert after == before


async def test_recording_and_stranger_are_refused_with_a_sentence(client, station):
    name = RobotId("eva-035")
    record = replace(robot_record(name, 9, "", TANK), kind="recorded", system_id=None, links=())
    await station.foundation.store.write(lambda session: add_robot(session, record))
    await station.refresh(name)
    refused = await client.post(f"/api/robots/{name}/maps/blue_light/comparison")
    assert refused.status_code == 409
    assert "recording" in refused.json()["detail"]
    assert (await client.get("/api/robots/nobody/maps/blue_light/comparison")).status_code == 404
    await until(lambda: station.maps.group(MINI) is not None)
    unknown = await client.get("/api/robots/mini-1/maps/salinity/comparison")
    assert unknown.status_code == 404
    assert "blue_light" in unknown.json()["detail"]


@pytest.mark.parametrize("count", [0, 1])
def test_hardly_any_sample_is_compared_without_an_error(count):
    found = compare_maps.run(problem(surveyed(4, 4)[:count]), print, never)
    for one in found.models:
        assert np.isfinite(one.mean).all()
        assert one.scores.rmse > 0.0


async def test_samples_that_the_map_carries_are_carried_for_models_learning_and_plans(
    client, station, world, monkeypatch
):
    await sampled(station, world)
    group = station.maps.group(MINI)
    flown = SimpleNamespace(
        known=Steady((0.002, 0.0)), is_carrier=lambda _: True, is_usable=lambda _: False
    )
    monkeypatch.setattr(station.currents, "of", lambda _: flown)
    problems = station.planning.problems
    with station.foundation.store.read() as session:
        columns = sample_columns(session, (MINI,), "blue_light")
    taken = field_samples(columns)

    async def where_all_have_them():
        planner = await station.planning.settings.merged(MINI, {})
        asked = await problems.map(MINI, planner)
        compared = _problem(
            group, columns, np.full((len(columns), 3), np.nan), station.maps.carrier(group)
        )
        np.testing.assert_array_equal(asked.samples.points, compared.samples.points)
        return compared

    still = await where_all_have_them()
    np.testing.assert_array_equal(still.samples.points, taken.points)
    answer = await client.patch("/api/config/field?robot=mini-1", json={"carriage": "water"})
    assert answer.status_code == 200, answer.text
    await until(lambda: station.maps.group(MINI).config.carriage == "water")
    group = station.maps.group(MINI)
    moved = await where_all_have_them()
    shift = moved.samples.points - taken.points
    assert np.all(shift[:20, 0] > 0.15)
    np.testing.assert_allclose(shift[:, 1:], 0.0, atol=1e-9)
    found = compare_maps.run(replace(moved, with_maps=False), print, never)
    assert compare_maps.CARRIED in found.message
