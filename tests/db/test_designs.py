from datetime import timedelta

import numpy as np
import pytest

from db.fault import UnknownIdError
from db.query.mission import design_templates as templates
from db.query.mission import designs as query
from tests.db.conftest import START


def document(number):
    return {"content": {"kind": "waypoints", "waypoints": [{"north_m": number, "east_m": 0.0}]}}


def in_turn(store, function, *args, **kwargs):
    """Call a query in a transaction of its own, as the station does."""
    return store.change(lambda session: function(session, *args, **kwargs)).result(60)


def begun(store):
    return in_turn(
        store,
        query.add_design,
        "mini-1",
        "Line",
        document(0),
        water="tank",
        what="New",
        at=START,
        by="ann",
    )


def changed(store, design, number, by="ann"):
    at = START + timedelta(seconds=number)
    return in_turn(
        store,
        query.change_document,
        design.id,
        document(number),
        f"Step {number}",
        revision=design.revision,
        at=at,
        by=by,
    )


def test_a_change_is_a_step_that_can_be_undone_and_done_again(store):
    design = changed(store, changed(store, begun(store), 1), 2)
    assert (design.undo, design.redo) == (("Step 2", "Step 1"), ())
    undone = in_turn(
        store, query.move_cursor, design.id, -1, revision=design.revision, at=START, by="bob"
    )
    assert undone.document == document(1)
    assert (undone.undo, undone.redo, undone.changed_by) == (("Step 1",), ("Step 2",), "bob")
    again = in_turn(
        store, query.move_cursor, design.id, 1, revision=undone.revision, at=START, by="bob"
    )
    assert again.document == document(2)
    with pytest.raises(query.NoSuchStepError):
        in_turn(store, query.move_cursor, design.id, 1, revision=again.revision, at=START, by="bob")


def test_undo_goes_back_fifty_steps_and_no_farther(store):
    design = begun(store)
    for number in range(1, 81):
        design = changed(store, design, number)
    assert len(design.undo) == query.STEPS_KEPT
    while design.undo:
        design = in_turn(
            store, query.move_cursor, design.id, -1, revision=design.revision, at=START, by="ann"
        )
    assert design.document == document(30)


def test_a_change_after_undoing_forgets_what_was_undone(store):
    design = changed(store, changed(store, begun(store), 1), 2)
    undone = in_turn(
        store, query.move_cursor, design.id, -1, revision=design.revision, at=START, by="ann"
    )
    other = changed(store, undone, 7)
    assert (other.undo, other.redo) == (("Step 7", "Step 1"), ())


def test_whoever_changes_an_older_revision_is_told_who_was_faster(store):
    design = begun(store)
    newest = changed(store, design, 1, by="bob")
    with pytest.raises(query.DesignChangedError) as refused:
        changed(store, design, 2)
    assert refused.value.design == newest
    assert in_turn(store, query.get_design, design.id).document == document(1)


def test_any_walk_of_changes_undos_and_redos_is_that_of_a_list_with_a_cursor(store):
    rng = np.random.default_rng()
    design = begun(store)
    steps, cursor = [document(0)], 0
    for number in range(1, 120):
        draw = rng.random()
        if draw < 0.5:
            design = changed(store, design, number)
            steps = [*steps[: cursor + 1], document(number)]
            cursor += 1
        else:
            way = -1 if draw < 0.8 else 1
            if not 0 <= cursor + way < len(steps):
                continue
            if (way < 0 and not design.undo) or (way > 0 and not design.redo):
                continue
            cursor += way
            design = in_turn(
                store,
                query.move_cursor,
                design.id,
                way,
                revision=design.revision,
                at=START,
                by="ann",
            )
        assert design.document == steps[cursor]
        assert len(design.redo) == len(steps) - 1 - cursor


def test_versions_stay_what_they_were(store):
    design = changed(store, begun(store), 1)
    first = in_turn(
        store,
        query.save_version,
        design.id,
        "As agreed",
        revision=design.revision,
        at=START,
        by="ann",
    )
    changed(store, design, 2)
    assert in_turn(store, query.get_version, design.id, first.number).document == document(1)
    assert in_turn(store, query.count_versions, "mini-1") == {design.id: 1}
    assert [one.comment for one in in_turn(store, query.list_versions, design.id)] == ["As agreed"]
    with pytest.raises(UnknownIdError):
        in_turn(store, query.get_version, design.id, 2)


def test_archived_designs_are_listed_apart(store):
    design = begun(store)
    in_turn(store, query.rename_design, design.id, is_archived=True, at=START, by="ann")
    assert in_turn(store, query.list_designs, "mini-1") == []
    assert [one.id for one in in_turn(store, query.list_designs, "mini-1", archived=True)] == [
        design.id
    ]


def test_a_template_is_kept_with_its_parameters(store):
    parameters = [{"key": "spacing", "paths": ["/content/spacing_m"]}]
    kept = in_turn(
        store, templates.add_template, "Lawn", document(1), parameters, at=START, by="ann"
    )
    assert in_turn(store, templates.get_template, kept.id).parameters == parameters
    in_turn(store, templates.archive_template, kept.id)
    assert in_turn(store, templates.list_templates) == []
