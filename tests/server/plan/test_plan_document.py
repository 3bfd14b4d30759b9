from dataclasses import replace

import numpy as np

from autonomy.planner.plan import Candidate, Leg, PrimitiveKind
from server.plan.document import candidate_of_draft, candidates_of, search_document

LEG = Leg(PrimitiveKind.DIVE, (0.0, 0.0, 0.0), (0.0, 0.0, 0.3), 0.05, 6.0, 1.0)
POINTS = np.array([[6.0, 0.0, 0.0, 0.3, 0.02]])
FOUND = Candidate((LEG,), POINTS, 38.2, 1.0, 6.0, 0.02, searched=41.9)


def test_document_keeps_the_worth_on_independent_points_and_what_the_search_counted():
    document = search_document("information_gain", "", FOUND, [replace(FOUND, searched=40.0)], ())
    assert (document["objective"], document["searched_objective"]) == (38.2, 41.9)
    assert [one.searched for one in candidates_of(document)] == [40.0]


def test_plan_of_an_earlier_version_opens_without_what_the_search_counted():
    document = search_document("information_gain", "", FOUND, [FOUND], ())
    del document["searched_objective"], document["runners_up"][0]["searched_objective"]
    assert [one.searched for one in candidates_of(document)] == [None]
    account = {"energy": 1.0, "duration_s": 6.0, "worst_std_m": 0.02}
    assert candidate_of_draft({**document, "account": account}).searched is None
