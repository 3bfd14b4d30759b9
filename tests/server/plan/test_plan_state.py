"""The table of a plan's states: every pair of state and evidence, and who may move a plan."""

from datetime import UTC, datetime
from itertools import product

import pytest
from hypothesis import given
from hypothesis import strategies as st

from db.query.mission.plans import ENDED_STATES, PlanStateError, add_plan, get_plan
from db.query.station.events import newest_events
from server.plan.state import ON_THE_WAY, TRANSITIONS, PlanEvidence, apply, leads_on
from tests.server.conftest import GRACE
from tests.server.one_writer import callers_of

STATES = ("planning", "draft", *ON_THE_WAY, *ENDED_STATES)
LADDER = {state: rank for rank, state in enumerate(("planning", "draft", *ON_THE_WAY))}
BY_ROBOT = [one for one in PlanEvidence if one.name.startswith("ROBOT_")]
AT = datetime(2026, 5, 1, tzinfo=UTC)


def rank(state):
    return LADDER.get(state, len(LADDER))


@pytest.mark.parametrize(("state", "evidence"), [*product(ENDED_STATES, PlanEvidence)])
def test_no_evidence_leads_out_of_an_end(state, evidence):
    assert not leads_on(state, evidence)


@pytest.mark.parametrize(("state", "evidence"), [*product(STATES, BY_ROBOT)])
def test_word_of_a_robot_never_leads_back(state, evidence):
    step = TRANSITIONS.get((state, evidence))
    is_dropped = evidence is PlanEvidence.ROBOT_DROPPED_IT
    assert step is None or rank(step.state) > rank(state) or is_dropped


def test_only_an_ended_transfer_and_a_robot_that_keeps_it_no_longer_lead_back():
    back = [one for one, step in TRANSITIONS.items() if rank(step.state) <= rank(one[0])]
    assert back == [
        ("sent", PlanEvidence.TRANSFER_ENDED),
        ("waiting", PlanEvidence.ROBOT_DROPPED_IT),
    ]


def test_plan_is_on_board_only_when_its_robot_said_so():
    proofs = {one for (_, one), step in TRANSITIONS.items() if step.state == "on_board"}
    assert proofs == {PlanEvidence.CONFIRMED, PlanEvidence.ROBOT_HAS_IT}


def test_table_names_known_states_and_the_event_of_each():
    assert {state for state, _ in TRANSITIONS} <= set(STATES)
    assert {evidence for _, evidence in TRANSITIONS} == set(PlanEvidence)
    for step in TRANSITIONS.values():
        assert step.state in STATES
        assert step.event == f"plan.{step.state}"


@given(story=st.lists(st.sampled_from(PlanEvidence), max_size=8))
def test_plan_follows_the_table_and_nothing_else(memory, story):
    def live(session):
        plan = add_plan(session, GRACE, "primitives", config={}, at=AT, by="test")
        state, told = "planning", []
        for evidence in story:
            step = TRANSITIONS.get((state, evidence))
            if step is None:
                with pytest.raises(PlanStateError):
                    apply(session, plan, evidence, "", AT)
            else:
                assert apply(session, plan, evidence, "", AT).state == step.state
                state = step.state
                told.append(step.event)
            assert get_plan(session, plan).state == state
        events = [one for one in newest_events(session, limit=100) if one.data.get("plan") == plan]
        return told, [one.kind for one in events]

    told, logged = memory.change(live).result(60)
    assert told == logged


def test_one_module_moves_plans():
    """Nobody else gives ``change_plan`` a state; what they know of a plan goes to ``apply``."""
    assert callers_of("change_plan", "state") == {"plan/state.py"}
