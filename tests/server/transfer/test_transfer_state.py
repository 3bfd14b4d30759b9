"""The table of a transfer's states: every pair of state and evidence, and who may move one."""

from datetime import UTC, datetime
from itertools import product

import pytest
from hypothesis import given
from hypothesis import strategies as st

from db.query.mission.plans import add_plan, get_plan
from db.query.mission.transfers import add_transfer, get_transfer
from server.plan import state as plan_state
from server.plan.state import PlanEvidence
from server.transfer.state import TRANSITIONS, TransferEvidence, WithdrawnError, apply, close
from tests.server.conftest import GRACE
from tests.server.one_writer import callers_of

AT = datetime(2026, 5, 1, tzinfo=UTC)
OPEN = ("waiting", "sending", "kept", "on_board", "running")
ENDS = ("failed", "withdrawn", "superseded")
BREAKS = [TransferEvidence(name) for name in ENDS]
PROVED_OF_PLAN = {
    "waiting": "draft",
    "sending": "sent",
    "kept": "waiting",
    "on_board": "on_board",
}
PLAN_STATES = ("draft", "sent", "waiting", "on_board")


@pytest.mark.parametrize(("state", "evidence"), [*product(ENDS, TransferEvidence)])
def test_no_evidence_leads_out_of_an_end(state, evidence):
    assert (state, evidence) not in TRANSITIONS


@pytest.mark.parametrize(("state", "evidence"), [*product(OPEN, TransferEvidence)])
def test_only_what_ends_a_transfer_leads_to_an_end(state, evidence):
    step = TRANSITIONS.get((state, evidence))
    ends = evidence in {*BREAKS, TransferEvidence.FINISHED}
    assert step is None or (step.event == "ends") == ends
    assert step is None or (step.state in ENDS) == (evidence in BREAKS)
    if evidence in BREAKS:
        assert step is not None, "an open transfer can always be broken off"


def test_transfer_is_on_board_only_when_the_robot_has_it():
    found = {pair for pair, step in TRANSITIONS.items() if step.state == "on_board"}
    has_it = TransferEvidence.ROBOT_HAS_IT
    assert found == {
        ("waiting", has_it),
        ("sending", has_it),
        ("kept", has_it),
        ("on_board", TransferEvidence.FINISHED),
    }


def test_word_of_a_robot_never_leads_back():
    for (state, evidence), step in TRANSITIONS.items():
        if evidence.value.startswith("robot"):
            assert OPEN.index(step.state) > OPEN.index(state)


def sent_draft(session):
    """Return a transfer that waits, and its plan, a draft."""
    plan = add_plan(session, GRACE, "primitives", config={}, at=AT, by="test")
    plan_state.apply(session, plan, PlanEvidence.MADE, "", AT)
    return add_transfer(session, plan, GRACE, items=3, size=9, start=True, at=AT), plan


@given(story=st.lists(st.sampled_from(TransferEvidence), max_size=8))
def test_transfer_follows_the_table_and_its_plan_what_it_proves(memory, story):
    def live(session):
        transfer, plan = sent_draft(session)
        state, has_ended, plan_is = "waiting", False, "draft"
        for evidence in story:
            step = TRANSITIONS.get((state, evidence))
            if evidence in BREAKS:
                close(session, transfer, evidence, "why", AT, calls_back=False)
                if not has_ended and plan_is == "sent":
                    plan_is = "draft"
            elif has_ended:
                with pytest.raises(WithdrawnError):
                    apply(session, transfer, evidence, AT)
            else:
                apply(session, transfer, evidence, AT)
                if step is not None and PROVED_OF_PLAN.get(step.state) in PLAN_STATES[1:]:
                    proved = PROVED_OF_PLAN[step.state]
                    plan_is = max(plan_is, proved, key=PLAN_STATES.index)
            if step is not None and not has_ended:
                state, has_ended = step.state, step.event == "ends"
            found = get_transfer(session, transfer)
            assert (found.state, found.ended_at is not None) == (state, has_ended)
            assert get_plan(session, plan).state == plan_is

    memory.change(live).result(60)


def test_one_module_moves_transfers():
    assert callers_of("change_transfer") == {"transfer/state.py"}


def test_transfers_and_commands_ask_nobody_again_and_again():
    waits = {file.partition("/")[0] for file in callers_of("sleep")}
    assert not waits & {"transfer", "command"}
