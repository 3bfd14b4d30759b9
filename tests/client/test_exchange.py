"""What is repeated, what is refused, and what an exception tells; sync and async alike."""

import httpx
import pytest

from grace_client import (
    ConflictError,
    FailedError,
    InvalidError,
    JobFailedError,
    NotSentError,
    OutcomeUnknownError,
    Patience,
    TooManyError,
    UnreachableError,
    VersionError,
    models,
)
from grace_client.exchange import Call, Pause, exchange
from grace_client.problem import problem_of
from tests.client.scripted import by_both, job, told

NOBODY = httpx.ConnectError("refused")
CUT = httpx.ReadError("cut off")
LEGS = [{"kind": "dive", "end_ned": [1.0, 2.0, 0.5]}]
HELD = told(
    {"detail": "The first request with this key is still being worked on."}, 409, Retry_After="1"
)


def same(runs, use):
    """Return what both clients made of a script, which is the same."""
    outcomes = [run(use) for run in runs]
    (first, station), (second, other) = outcomes
    assert repr(first) == repr(second)
    assert [one[:2] for one in station.said] == [one[:2] for one in other.said]
    return first, station


def test_a_read_is_repeated_until_the_station_answers():
    runs = by_both(NOBODY, CUT, told({"robots": []}, 503), told({"jobs": []}))
    found, station = same(runs, lambda client: client.ask.jobs.list_jobs())
    assert found.jobs == []
    assert len(station.asked) == 4


def test_a_plan_is_asked_for_again_under_the_same_key():
    started = told({"id": "plan-1"}, 202)
    body = models.PrimitivesPlanRequest(kind="primitives", legs=[models.LegBody(**LEGS[0])])
    runs = by_both(CUT, CUT, started)
    found, station = same(runs, lambda client: client.ask.plans.create_plan("mini-1", body))
    assert found.id == "plan-1"
    keys = {one.headers["Idempotency-Key"] for one in station.asked}
    assert (len(station.asked), len(keys)) == (3, 1)
    assert station.said[0][2] == {"kind": "primitives", "legs": LEGS}


def test_two_plans_have_two_keys():
    runs = by_both(told({"id": "plan-1"}, 202), told({"id": "plan-1"}, 202))
    for run in runs:
        if run.__name__ == "sync":
            _, station = run(
                lambda client: [client.ask.plans.cancel_plan("plan-1") for _ in range(2)]
            )
            assert len({one.headers["Idempotency-Key"] for one in station.asked}) == 2


def test_a_change_without_a_key_is_not_repeated_once_it_may_have_arrived():
    runs = by_both(CUT, told({}))
    found, station = same(runs, lambda client: client.ask.waters.patch_water("lake", {}))
    assert isinstance(found, UnreachableError)
    assert len(station.asked) == 1


def test_what_nobody_took_is_repeated_whatever_it_is():
    runs = by_both(NOBODY, told({"detail": "No."}, 404))
    found, station = same(runs, lambda client: client.ask.waters.patch_water("lake", {}))
    assert len(station.asked) == 2
    assert "No." in str(found)


def steps(call, *replies, patience=None):
    """Run a flow without I/O; return its pauses, s, and what came of it."""
    flow = exchange(call, patience or Patience(draw=lambda: 1.0))
    pauses, waiting = [], list(replies)
    step = next(flow)
    try:
        while True:
            if isinstance(step, Pause):
                pauses.append(step.seconds)
                step = flow.send(None)
                continue
            reply = waiting.pop(0)
            if not isinstance(reply, Exception):
                reply = reply()
                reply.request = httpx.Request(step.method, f"http://station{step.path}")
            step = flow.send(reply)
    except StopIteration as end:
        return pauses, end.value
    except Exception as error:  # noqa: BLE001 - the test looks at it
        return pauses, error


def test_pauses_double_up_to_the_longest():
    pauses, end = steps(Call("GET", "/api/jobs"), *[NOBODY] * 8, told({}))
    assert pauses == [0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 8.0, 8.0]
    assert end.status_code == 200


def test_half_of_a_pause_is_drawn():
    patience = Patience(draw=lambda: 0.0)
    pauses, _ = steps(Call("GET", "/api/jobs"), NOBODY, told({}), patience=patience)
    assert pauses == [0.125]


def test_a_station_that_says_when_to_come_again_is_obeyed():
    many = told({"detail": "Too many."}, 429, Retry_After="12")
    pauses, end = steps(Call("PATCH", "/api/waters/lake"), many, told({}))
    assert (pauses, end.status_code) == ([12.0], 200)


def test_a_client_that_has_no_patience_left_says_why():
    many = [told({"detail": "Too many."}, 429, Retry_After="40") for _ in range(3)]
    pauses, end = steps(Call("GET", "/api/jobs"), *many)
    assert pauses == [40.0]
    assert isinstance(end, TooManyError)
    assert end.retry_after_s == 40.0


def test_a_request_that_is_worked_on_is_waited_for():
    pauses, end = steps(Call("POST", "/api/x", takes_key=True), HELD, told({}, 202))
    assert (pauses, end.status_code) == ([1.0], 202)


def test_a_conflict_is_not_repeated():
    pauses, end = steps(Call("GET", "/api/x"), told({"detail": "It is a draft."}, 409))
    assert pauses == []
    assert type(end) is ConflictError


def test_a_problem_names_field_and_limit():
    body = {
        "detail": "1 field is wrong.",
        "errors": [{"loc": ["config", "max_depth_m"], "msg": "must be at most 30"}],
    }
    runs = by_both(told(body, 422))
    found, _ = same(runs, lambda client: client.plan("mini-1", LEGS))
    assert isinstance(found, InvalidError)
    (field,) = found.fields
    assert (field.path, field.message) == (("config", "max_depth_m"), "must be at most 30")
    assert "config.max_depth_m: must be at most 30" in str(found)
    assert "POST /api/robots/mini-1/plans (422)" in str(found)


def test_an_outcome_that_nobody_knows_is_no_conflict_like_others():
    answer = told(
        {"detail": "Look."}, 409, Idempotency_Outcome="unknown", Location="/api/jobs/job-7"
    )()
    answer.request = httpx.Request("POST", "http://station/api/x")
    error = problem_of(answer)
    assert isinstance(error, OutcomeUnknownError)
    assert error.location == "/api/jobs/job-7"


def test_an_answer_of_a_proxy_is_a_problem_too():
    answer = httpx.Response(502, text="<html>Bad gateway</html>")
    answer.request = httpx.Request("POST", "http://station/api/x")
    error = problem_of(answer)
    assert isinstance(error, FailedError)
    assert error.detail == "Bad Gateway"


@pytest.mark.parametrize(
    "use",
    [
        lambda client: client.send("plan-1"),
        lambda client: client.command("mini-1", "hold"),
        lambda client: client.ask.transfers.upload_plan("plan-1"),
        lambda client: client.ask.missions.start_mission("mission-1"),
        lambda client: client.ask.missions.create_mission(
            "mini-1", models.MissionRequest(kind="adaptive_survey", automation=True)
        ),
        lambda client: client.ask.trim.accept_advice(
            "mini-1", models.TrimAcceptance(advice="advice-1")
        ),
    ],
)
def test_a_client_that_may_not_send_sends_nothing(use):
    found, station = same(by_both(), use)
    assert isinstance(found, NotSentError)
    assert "may_send=True" in str(found)
    assert station.asked == []


def test_a_client_that_may_not_send_brings_a_robot_up_all_the_same():
    command = {
        "id": "command-1", "robot": "mini-1", "kind": "surface", "level": "created", "levels": [],
        "created_at": "2026-01-01T00:00:00Z", "expires_at": "2026-01-01T00:10:00Z", "text": "Up.",
    }  # fmt: skip
    runs = by_both(told({"id": "command-1"}, 202), told(command))
    found, station = same(runs, lambda client: client.surface_now("mini-1"))
    assert found.kind == "surface"
    assert station.said[0] == ("POST", "/api/robots/mini-1/commands", {"kind": "surface"})


def test_a_client_that_may_send_does():
    runs = by_both(told({"id": "mission-1"}, 202), may_send=True)
    found, station = same(runs, lambda client: client.ask.missions.start_mission("mission-1"))
    assert found.id == "mission-1"
    assert len(station.asked) == 1


def test_a_plan_of_a_survey_is_no_order():
    runs = by_both(told({"id": "mission-1"}, 202))
    body = models.MissionRequest(kind="adaptive_survey")
    found, _ = same(runs, lambda client: client.ask.missions.create_mission("mini-1", body))
    assert found.id == "mission-1"


@pytest.mark.parametrize("version", ["0.0.9", "1.0.0", "unknown"])
def test_a_station_of_another_release_is_told_of_before_anything_is_asked(version):
    runs = by_both(version=version)
    found, station = same(runs, lambda client: client.ask.jobs.list_jobs())
    assert isinstance(found, VersionError)
    assert version in str(found)
    assert station.asked == []


def test_an_answer_that_the_client_does_not_know_says_which_client_would():
    runs = by_both(told({"jobs": "none"}))
    found, _ = same(runs, lambda client: client.ask.jobs.list_jobs())
    assert isinstance(found, VersionError)
    assert "GET /api/jobs" in str(found)


def test_what_a_newer_station_tells_beyond_is_left_out():
    runs = by_both(told({"jobs": [], "colour": "blue"}))
    found, _ = same(runs, lambda client: client.ask.jobs.list_jobs())
    assert found == models.JobsView(jobs=[])


FILM = {"film": "film-1", "sha256": "ab", "bytes": 3, "kind": "page", "name": "a.html"}


def test_a_path_holds_its_values_as_they_are():
    runs = by_both(told(job("done")))
    _, station = same(runs, lambda client: client.ask.jobs.get_job("../robots"))
    assert station.said[0][1] == "/api/jobs/..%2Frobots"


def test_the_result_of_a_job_is_waited_for_over_a_restart():
    begun, running = told(job("running"), 202), told(job("running"))
    done = told(job("done", result={"answer": 42}))
    for run in by_both(begun, running, CUT, NOBODY, done):
        sync = run.__name__ == "sync"

        async def later(client):
            return await (await client.ask.on_board.read_parameters("mini-1")).result()

        found, station = run(
            later if not sync else lambda c: c.ask.on_board.read_parameters("mini-1").result()
        )
        assert found == {"answer": 42}
        assert "until=end" in station.said[1][1]


def test_a_job_that_failed_says_why():
    failed = told(job("failed", message="The file is empty."))
    sync, _ = by_both(told(job("running"), 202), failed)
    found, _ = sync(lambda client: client.ask.on_board.read_parameters("mini-1").result())
    assert isinstance(found, JobFailedError)
    assert "The file is empty." in str(found)
    assert found.job.state == "failed"


def test_a_job_that_goes_on_ends_the_wait_in_time():
    sync, _ = by_both(told(job("running"), 202), told(job("running")), told(job("running")))
    found, _ = sync(lambda c: c.ask.on_board.read_parameters("mini-1").result(timeout_s=0.0))
    assert isinstance(found, TimeoutError)
