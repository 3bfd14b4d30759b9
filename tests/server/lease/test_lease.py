"""Who is in charge: take, request, grant, refuse, hand over, release, and who falls silent."""

import asyncio

import pytest

from server.access.role import Role
from server.base.configuration import CurrentConfiguration
from server.lease.leases import Leases
from tests.server.conftest import GRACE, MINI, until
from tests.server.lease.conftest import act, lease_of, let_pilot
from tests.server.station_parts import OpenStation


async def kinds(client, robot=MINI):
    """The story of a lease as the log has it, with who caused each step."""
    answer = await client.get("/api/events", params={"robot": robot, "limit": 100})
    return [(one["kind"], one["by"]) for one in answer.json()["events"] if "lease." in one["kind"]]


async def in_charge(client, name, robot=MINI):
    return await until(lambda: _held_by(client, name, robot))


async def _held_by(client, name, robot):
    lease = await lease_of(client, robot)
    return lease if lease["holder"] == name and lease["state"] == "held" else None


async def test_a_free_robot_is_taken_and_both_see_who_has_it(person):
    ann, ben = await person("ann"), await person("ben")
    assert (await lease_of(ann))["state"] == "free"
    taken = (await act(ann, "take")).json()
    assert taken["is_mine"]
    assert taken["refusal"] == ""
    seen = await lease_of(ben)
    assert (seen["holder"], seen["is_mine"], seen["is_silent"]) == ("ann", False, False)
    assert "ann is in charge of mini-1; request it" in seen["refusal"]


async def test_of_two_who_take_at_once_one_has_it_and_the_other_is_told_who(person):
    people = {name: await person(name) for name in ("ann", "ben", "carl", "dora")}
    answers = await asyncio.gather(*(act(client, "take") for client in people.values()))
    won = [name for name, answer in zip(people, answers, strict=True) if answer.status_code == 200]
    assert len(won) == 1
    for answer in answers:
        if answer.status_code != 200:
            assert answer.status_code == 409
            assert f"{won[0]} is in charge of {MINI} and is there" in answer.json()["detail"]
    assert await kinds(people["ann"]) == [("lease.taken", won[0])]


async def test_a_request_is_granted_by_who_is_in_charge(person):
    ann, ben = await person("ann"), await person("ben")
    await act(ann, "take")
    asked = (await act(ben, "request", note="I see it best")).json()
    assert asked["state"] == "requested"
    seen = (await lease_of(ann))["request"]
    assert (seen["by"], seen["note"]) == ("ben", "I see it best")
    granted = (await act(ann, "grant", to="ben")).json()
    assert (granted["holder"], granted["is_mine"], granted["request"]) == ("ben", False, None)
    assert await kinds(ann) == [
        ("lease.taken", "ann"), ("lease.requested", "ben"), ("lease.granted", "ann"),
    ]  # fmt: skip


async def test_a_request_is_refused_with_the_reason_and_the_robot_stays(person):
    ann, ben = await person("ann"), await person("ben")
    await act(ann, "take")
    await act(ben, "request")
    refused = (await act(ann, "refuse", to="ben", note="in the middle of a dive")).json()
    assert (refused["holder"], refused["state"]) == ("ann", "held")
    answer = await ann.get("/api/events", params={"robot": MINI})
    assert "in the middle of a dive" in answer.json()["events"][-1]["text"]


async def test_an_answer_to_somebody_who_asks_no_more_gives_the_robot_to_nobody_else(person):
    ann, ben, carl = await person("ann"), await person("ben"), await person("carl")
    await act(ann, "take")
    await act(ben, "request")
    assert (await act(carl, "request")).status_code == 409
    await act(ben, "withdraw")
    await act(carl, "request")
    answer = await act(ann, "grant", to="ben")
    assert answer.status_code == 409
    assert "ben does not ask for mini-1 any more" in answer.json()["detail"]
    assert (await lease_of(ann))["request"]["by"] == "carl"


@pytest.mark.parametrize("do", ["grant", "refuse", "hand_over", "release"])
async def test_only_who_is_in_charge_answers_hands_over_and_releases(person, do):
    ann, ben = await person("ann"), await person("ben")
    await act(ann, "take")
    await act(ben, "request")
    answer = await act(ben, do, to="ben")
    assert answer.status_code == 409
    assert "only who is in charge" in answer.json()["detail"]
    assert (await lease_of(ann))["holder"] == "ann"


async def test_a_robot_is_handed_to_somebody_who_is_there_and_may_pilot(person, hours):
    ann, ben, vic = await person("ann"), await person("ben"), await person("vic", Role.VIEWER)
    await act(ann, "take")
    for name, status in (("nobody", 422), ("vic", 422)):
        await lease_of(vic)
        answer = await act(ann, "hand_over", to=name)
        assert answer.status_code == status
        assert answer.json()["errors"][0]["loc"] == ["to"]
    hours.passed_s = 400.0
    answer = await act(ann, "hand_over", to="ben")
    assert answer.status_code == 409
    assert "ben is not there" in answer.json()["detail"]
    await lease_of(ben)
    assert (await act(ann, "hand_over", to="ben")).json()["holder"] == "ben"


async def test_a_robot_that_is_given_back_goes_to_who_asked_else_to_nobody(person):
    ann, ben = await person("ann"), await person("ben")
    await act(ann, "take")
    await act(ben, "request")
    assert (await act(ann, "release")).json()["holder"] == "ben"
    assert (await act(ben, "release")).json()["state"] == "free"


async def test_the_end_of_a_shift_gives_every_robot_back(person):
    ann, ben = await person("ann"), await person("ben")
    await act(ann, "take", MINI)
    await act(ann, "take", GRACE)
    await act(ben, "request", GRACE)
    left = (await ann.post("/api/leases/release")).json()
    assert {one["robot"]: one["holder"] for one in left} == {MINI: "", GRACE: "ben"}
    assert [one["state"] for one in (await ann.get("/api/leases")).json()] == ["free", "held"]


async def test_a_silent_pilot_keeps_the_robot_until_another_takes_charge(person, hours):
    ann, ben = await person("ann"), await person("ben")
    await act(ann, "take")
    hours.passed_s = 299.0
    assert (await act(ben, "take")).status_code == 409
    hours.passed_s = 301.0
    seen = await lease_of(ben)
    assert (seen["holder"], seen["is_silent"]) == ("ann", True)
    assert seen["refusal"].endswith("silent for 5 min; take charge first.")
    assert (await act(ben, "take")).json()["is_mine"]
    assert (await kinds(ben))[-1] == ("lease.taken_over", "ben")


async def test_a_request_to_a_silent_pilot_is_granted_at_once(person, hours):
    ann, ben = await person("ann"), await person("ben")
    await act(ann, "take")
    hours.passed_s = 301.0
    assert (await act(ben, "request")).json()["is_mine"]
    assert [kind for kind, _ in await kinds(ben)][-2:] == ["lease.requested", "lease.timed_out"]


async def test_a_request_is_granted_by_itself_once_the_pilot_has_fallen_silent(
    station, person, hours
):
    """The laptop died after the request: nobody has to press anything again."""
    ann, ben = await person("ann"), await person("ben")
    await act(ann, "take")
    await act(ben, "request")
    hours.passed_s = 301.0
    leases = station.foundation.services.get(Leases)
    leases._looks.wake(MINI)
    assert (await in_charge(ben, "ben"))["is_mine"]
    assert (await kinds(ben))[-1] == ("lease.timed_out", None), "the station did it"


async def test_an_open_page_that_nobody_sits_at_holds_a_robot_no_longer_than_an_answer_takes(
    station, person, hours
):
    ann, ben = await person("ann"), await person("ben")
    await act(ann, "take")
    leases = station.foundation.services.get(Leases)
    presence = leases._presence
    presence._open["session", "ann"] += 1
    await act(ben, "request")
    hours.passed_s = 600.0
    asked = (await lease_of(ben))["request"]
    assert asked["granted_in_s"] == pytest.approx(300.0, abs=100.0)
    hours.passed_s = 901.0
    leases._looks.wake(MINI)
    assert await in_charge(ben, "ben")


async def test_a_pilot_who_works_on_is_not_relieved_by_the_clock(person, hours):
    ann, ben = await person("ann"), await person("ben")
    await act(ann, "take")
    await act(ben, "request")
    hours.passed_s = 280.0
    await ann.post("/api/session/ticket")
    hours.passed_s = 560.0
    await ann.post("/api/session/ticket")
    assert (await lease_of(ben))["request"]["granted_in_s"] > 250.0


async def test_somebody_who_may_pilot_no_more_is_waited_for_by_nobody(person):
    ann, ben, admin = await person("ann"), await person("ben"), await person("root", Role.ADMIN)
    await act(ann, "take")
    assert (await admin.patch("/api/people/ann", json={"disabled": True})).status_code == 200
    assert (await act(ben, "take")).json()["is_mine"]


async def test_an_administrator_takes_over_at_once_with_a_reason(person):
    ann, admin = await person("ann"), await person("root", Role.ADMIN)
    await act(ann, "take")
    answer = await act(admin, "take")
    assert answer.status_code == 409
    assert "give a reason" in answer.json()["detail"]
    assert (await act(admin, "take", note="a storm is coming")).json()["is_mine"]
    answer = await ann.get("/api/events", params={"robot": MINI})
    assert "a storm is coming" in answer.json()["events"][-1]["text"]
    assert "ann before" in answer.json()["events"][-1]["text"]


async def test_a_pilot_s_reason_takes_nothing_over(person):
    ann, ben = await person("ann"), await person("ben")
    await act(ann, "take")
    assert (await act(ben, "take", note="please")).status_code == 409


async def test_a_person_takes_over_from_a_script_and_a_script_from_no_person(person, script):
    ann, planner = await person("ann"), await script("planner", Role.ADMIN)
    assert (await act(planner, "take")).json()["holder_kind"] == "script"
    assert (await act(ann, "take")).json()["is_mine"]
    answer = await act(planner, "take", note="mine")
    assert answer.status_code == 409
    assert "a script takes over from nobody" in answer.json()["detail"]
    assert (await act(planner, "request")).status_code == 409


async def test_a_viewer_has_no_say(person):
    vic = await person("vic", Role.VIEWER)
    assert (await act(vic, "take")).status_code == 403
    assert (await vic.put("/api/automation", json={"is_held": True})).status_code == 403
    assert (await lease_of(vic))["state"] == "free"


async def test_the_limits_are_settings_of_each_robot(person, hours):
    ann, ben = await person("ann"), await person("ben")
    patch = {"silent_s": 30.0}
    answer = await ann.patch("/api/config/lease", params={"robot": MINI}, json=patch)
    assert answer.status_code == 200, answer.text
    await act(ann, "take")
    hours.passed_s = 31.0
    assert (await act(ben, "take")).json()["is_mine"]


async def test_who_pilots_one_robot_by_a_grant_keeps_it_until_the_grant_ends(
    station: OpenStation, person
):
    ann, ben = await person("ann"), await person("ben", Role.NONE)
    await let_pilot(station, "ben", MINI)
    assert (await act(ben, "take")).json()["is_mine"]
    assert (await act(ann, "take")).status_code == 409, "ben is there and may pilot it"
    await let_pilot(station, "ben", GRACE)
    assert (await act(ann, "take")).json()["is_mine"]


async def test_a_robot_is_handed_to_nobody_who_pilots_others_alone(station: OpenStation, person):
    ann, ben = await person("ann"), await person("ben", Role.NONE)
    await let_pilot(station, "ben", GRACE)
    assert (await ben.get("/api/session")).status_code == 200, "ben is there"
    await act(ann, "take")
    refused = await act(ann, "hand_over", to="ben")
    assert refused.status_code == 422
    assert f"may pilot {MINI}" in refused.text
    await let_pilot(station, "ben", MINI)
    assert (await act(ann, "hand_over", to="ben")).json()["holder"] == "ben"


async def test_limits_that_were_read_before_they_changed_are_not_kept(
    station: OpenStation, monkeypatch: pytest.MonkeyPatch
):
    leases, book = station.foundation.services.get(Leases), station.foundation.configurations
    read = book.current

    async def slowly(kind: str, robot: str | None) -> CurrentConfiguration:
        found = await read(kind, robot)
        monkeypatch.setattr(book, "current", read)
        await book.patch("lease", MINI, {"silent_s": 77.0}, by="ann")
        return found

    monkeypatch.setattr(book, "current", slowly)
    assert (await leases.limits(MINI)).silent_s != 77.0
    assert (await leases.limits(MINI)).silent_s == 77.0
