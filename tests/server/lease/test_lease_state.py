"""The table of leases, and what holds after any story of two people, a script and the clock."""

from datetime import UTC, datetime, timedelta

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from sqlalchemy.orm import Session

from db.query.fleet.leases import LeaseRecord, get_lease
from db.query.station.events import EventFilter, newest_events
from server.lease.state import TRANSITIONS, Holder, LeaseEvidence, apply
from tests.server.conftest import MINI
from tests.server.one_writer import callers_of

STATES = ("free", "held", "requested")
WHO = st.sampled_from([Holder("ann"), Holder("ben"), Holder("planner", "script", "token-1")])
NEEDS_ONE = {
    LeaseEvidence.TAKEN,
    LeaseEvidence.TAKEN_OVER,
    LeaseEvidence.REQUESTED,
    LeaseEvidence.HANDED_OVER,
    LeaseEvidence.SCRIPT_LET,
}
STORY = st.lists(st.tuples(st.sampled_from(LeaseEvidence), WHO), max_size=25)
NOW = datetime(2026, 5, 4, 6, tzinfo=UTC)


class Undone(Exception):  # noqa: N818 - no fault: it takes a story's transaction back
    pass


def told_in_one(memory, story, check):
    """Tell a story to a fresh lease in one transaction, look at it, and take it back."""

    def write(session: Session) -> None:
        for number, (evidence, one) in enumerate(story):
            before, at = get_lease(session, MINI), NOW + timedelta(seconds=number)
            to = one if evidence in NEEDS_ONE else None
            after = apply(session, MINI, evidence, f"{number}.", at, to=to)
            check(session, before, evidence, one, after)
        raise Undone

    with pytest.raises(Undone):
        memory.change(write).result()


def test_table_names_known_states_and_every_evidence():
    assert {state for state, _ in TRANSITIONS} == set(STATES)
    assert {step.state for step in TRANSITIONS.values()} == set(STATES)
    assert {evidence for _, evidence in TRANSITIONS} == set(LeaseEvidence)
    assert all(step.event.startswith("lease.") for step in TRANSITIONS.values())


def test_only_who_is_in_charge_makes_a_robot_free():
    to_free = {pair for pair, step in TRANSITIONS.items() if step.state == "free"}
    assert to_free == {("held", LeaseEvidence.RELEASED)}


def test_one_module_moves_leases():
    assert callers_of("put_lease") == {"lease/state.py"}


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(story=STORY)
def test_whatever_happens_a_robot_has_one_master_or_is_free(memory, story):
    def check(session, before, evidence, one, after):
        del evidence, one
        now = get_lease(session, MINI)
        assert now == (before if after is None else after)
        assert (now.holder is None) == (now.state == "free") == (now.since is None)
        assert (now.requested_by is None) == (now.state != "requested")
        assert (now.requested_at is None) == (now.requested_by is None)
        assert now.state != "free" or now == LeaseRecord(MINI, reason=now.reason)

    told_in_one(memory, story, check)


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(story=STORY)
def test_every_change_leaves_one_event_that_says_who_to_whom(memory, story):
    def check(session, before, evidence, one, after):
        del evidence, one
        events = newest_events(session, EventFilter(robot=MINI, kinds=kinds), 100)
        assert len(events) == seen["events"] + (after is not None)
        seen["events"] = len(events)
        if after is not None:
            data = events[-1].data
            assert (data["from"], data["to"]) == (before.holder, after.holder)

    seen = {"events": 0}
    kinds = tuple({step.event for step in TRANSITIONS.values()})
    told_in_one(memory, story, check)


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(story=STORY)
def test_a_script_acts_under_a_person_only_as_long_as_that_person_is_in_charge(memory, story):
    def check(session, before, evidence, one, after):
        del session, one
        if after is None or evidence is LeaseEvidence.SCRIPT_LET:
            return
        same = (before.holder, before.holder_kind) == (after.holder, after.holder_kind)
        moved_anew = before.since != after.since
        if not same or moved_anew:
            assert after.script is None
            assert after.script_token is None

    told_in_one(memory, story, check)
