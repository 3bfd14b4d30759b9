"""The table of scheduled sends: every pair of state and evidence, and who may move one."""

from itertools import product

import pytest

from server.schedule.state import TRANSITIONS, SendEvidence
from tests.server.one_writer import callers_of

ENDS = ("done", "expired", "cancelled", "withdrawn", "failed")


@pytest.mark.parametrize(("state", "evidence"), [*product(ENDS, SendEvidence)])
def test_no_evidence_leads_out_of_an_end(state, evidence):
    assert (state, evidence) not in TRANSITIONS


def test_table_names_known_states_and_the_event_of_each():
    assert {evidence for _, evidence in TRANSITIONS} == set(SendEvidence)
    for step in TRANSITIONS.values():
        assert step.event == f"schedule.{step.state}"


@pytest.mark.parametrize("state", ["waiting", "sent"])
def test_what_waits_can_always_be_ended(state):
    for evidence in (SendEvidence.CANCELLED, SendEvidence.PURGED, SendEvidence.EXPIRED):
        assert TRANSITIONS[state, evidence].state in ENDS


def test_one_module_moves_them():
    assert callers_of("change_scheduled_send") == {"schedule/state.py"}
