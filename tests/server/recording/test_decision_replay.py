"""Decisions are made once more of what they were made of; a changed input shows."""

import zlib
from dataclasses import fields, replace

import pytest

from db.query.mission.decisions import (
    DecisionRange,
    NewDecision,
    add_decision,
    content_of,
    list_decisions,
)
from server.base.decision.content import packed, unpacked
from server.base.decision.replay import DecisionReplay
from server.plan.search import task as planner
from server.plan.task import SurveyProblem
from server.recording.decision_kind import KINDS
from tests.server.conftest import FAST, until
from tests.server.map.test_map_learning import ended, mapped, tell_samples

pytestmark = pytest.mark.usefixtures("in_threads")
BY_CLOCK = {**FAST, "search": {"iterations_max": 0}, "adaptive": {"rehearse": False}}


async def begun(client, **config):
    body = {"kind": "adaptive_survey", "config": BY_CLOCK | config}
    answer = await client.post("/api/robots/mini-1/plans", json=body)
    assert answer.status_code == 202, answer.text
    return answer.json()["id"]


async def decisions_of(station):
    return await station.foundation.store.query(lambda s: list_decisions(s, DecisionRange()))


async def words(station):
    """Replay all decisions; return the words and why."""
    replay = DecisionReplay(station.foundation.store, station.workers, KINDS)
    verdicts = await replay.run(DecisionRange(), lambda _share, _text: None)
    return [one.word for one in verdicts], [one.because for one in verdicts]


async def add(station, decision, **changes):
    """Add a decision like another one."""
    kept = {field.name: getattr(decision, field.name) for field in fields(NewDecision)}
    contents = changes.pop("contents", {})
    deflated = {name: zlib.compress(content) for name, content in contents.items()}
    new = NewDecision(**kept | changes)
    await station.foundation.store.write(lambda session: add_decision(session, new, deflated))


async def of_other_seed(station, decision):
    """Return the same problem with another seed."""

    def read(session):
        problem = unpacked(SurveyProblem, decision.input_sha256, lambda n: content_of(session, n))
        planner = problem.planner.model_copy(update={"seed": problem.planner.seed + 1})
        return packed(replace(problem, planner=planner), SurveyProblem)

    return await station.foundation.store.query(read)


async def test_plans_are_made_the_same_once_more_and_whatever_was_changed_shows(
    client, station, monkeypatch
):
    plan = await begun(client, planning_time_s=5.0)

    async def is_draft():
        return (await client.get(f"/api/plans/{plan}")).json()["state"] == "draft"

    await until(is_draft)
    told, real = [], planner.plan

    def watched(*args, on_progress, **more):
        return real(*args, on_progress=told.append, **more)

    monkeypatch.setattr(planner, "plan", watched)
    stopped = await begun(client, planning_time_s=60.0)
    await until(lambda: told)
    await client.post(f"/api/plans/{stopped}/cancel")
    found, cancelled = await decisions_of(station)
    assert (found.about, found.state) == (plan, "done")
    assert (cancelled.about, cancelled.state) == (stopped, "cancelled")
    assert cancelled.document["stopped_at"] == cancelled.document["pace"]["iterations"] + 1
    assert await words(station) == (["same"] * 2, [""] * 2)

    other = await of_other_seed(station, found)
    await add(station, found, input_sha256=other.sha256, contents=other.contents)
    await add(station, found, input_sha256="0" * 64)
    await add(station, found, outcome_sha256=None, state="ended")
    software = found.document["software"] | {"numpy": "1.0"}
    await add(station, found, document=found.document | {"software": software})
    said, because = await words(station)
    assert said == ["same", "same", "different", "cannot", "cannot", "cannot"]
    assert "then and" in because[2]
    assert "not kept whole" in because[3]
    assert "before it could say how far" in because[4]
    assert "numpy was 1.0 then" in because[5]


async def test_what_is_learned_and_compared_of_a_map_is_found_the_same_once_more(
    client, station, world
):
    tell_samples(world, 30)
    await mapped(station, 30)
    for work in ("comparison", "learning"):
        answer = await client.post(f"/api/robots/mini-1/maps/blue_light/{work}")
        assert (await ended(station, answer.json()["id"])).state == "done"
    answer = await client.post("/api/robots/mini-1/decisions/replay")
    assert answer.status_code == 202, answer.text
    job = await ended(station, answer.json()["id"])
    assert (job.state, job.result["same"]) == ("done", 2), job.result
    shown = (await client.get("/api/robots/mini-1/decisions")).json()
    assert [(one["kind"], one["verdict"]) for one in shown["decisions"]] == [
        ("comparison", "same"),
        ("kernels", "same"),
    ]
    assert shown["count"] == 2
    one, other = shown["decisions"]
    assert one["map_sha256"] == other["map_sha256"]
    others = (await client.get("/api/robots/grace-1/decisions")).json()
    assert others["decisions"] == []
