"""A parameter beyond the box is found; where the box ends too soon, nobody is sure beside it."""

from dataclasses import replace

import numpy as np
import pytest

from autonomy.identification.box import at_border, widened
from autonomy.identification.config import IdentificationConfig, NoiseLevels
from autonomy.identification.identifiability import judge
from autonomy.identification.normal_equations import Information
from autonomy.identification.problem import problem_from
from autonomy.identification.progress import IdentificationCancelledError
from autonomy.identification.recording import Recording
from autonomy.identification.result import IdentificationResult
from autonomy.identification.run import identify
from autonomy.identification.unknown import Unknown
from autonomy.vehicle.config import MINIGLIDER, Vehicle
from benchmarks.estimation.identification_coverage import FREE
from tests.autonomy.identification_flight import open_loop_recording

CONFIG = IdentificationConfig(
    method="least_squares",
    model="thesis",
    fits_offsets=False,
    step_s=0.5,
    free=FREE,
    noise=NoiseLevels(fix_hold_s=0.0),
)
NARROW = CONFIG.model_copy(update={"widest_share": 0.5})


def with_parameters(**factors: float) -> Vehicle:
    """Return the Miniglider with some parameters multiplied."""
    values = MINIGLIDER.parameters.model_dump()
    changed = {name: factor * values[name] for name, factor in factors.items()}
    return replace(MINIGLIDER, parameters=MINIGLIDER.parameters.model_copy(update=changed))


TRUTH = with_parameters(drag_0=1.9, pitch_0_m=0.3, lift_alpha=1.3)


@pytest.fixture(scope="module")
def recording() -> Recording:
    return open_loop_recording(
        TRUTH, np.random.default_rng(3), runs=8, duration_s=25.0, period_s=0.5
    )


def run(recording: Recording, config: IdentificationConfig, **options) -> IdentificationResult:
    given = {"report": lambda _: None, "is_cancelled": lambda: False} | options
    return identify(
        problem_from(MINIGLIDER, recording, config), config, np.random.default_rng(1), **given
    )


def test_truth_beyond_the_box_is_found_and_said(recording):
    result = run(recording, CONFIG)
    assert result.is_converged
    assert result.cost_after == pytest.approx(1.0, abs=0.15)
    drag = result.parameter("drag_0")
    assert drag.verdict == "identified"
    truth = TRUTH.parameters.model_dump()
    for estimate in result.parameters:
        if estimate.verdict == "identified":
            assert estimate.std is not None
            assert abs(estimate.after - truth[estimate.name]) < 4.0 * estimate.std, estimate.name
    said = [finding for finding in result.findings if "was widened" in finding]
    assert len(said) == 1
    assert "the box of ±50 % was widened" in said[0]
    assert "pitch moment (constant) (-" in said[0]
    assert "drag (constant) (+" in said[0]
    assert not any("stands at the border" in finding for finding in result.findings)


def test_nobody_is_sure_beside_a_parameter_at_the_border(recording):
    result = run(recording, NARROW)
    assert result.parameter("drag_0").verdict == "weak"
    truth = TRUTH.parameters.model_dump()
    wrong = [
        estimate.name
        for estimate in result.parameters
        if estimate.verdict == "identified"
        and estimate.std is not None
        and abs(estimate.after - truth[estimate.name]) > 3.0 * estimate.std
    ]
    assert not wrong
    said = [finding for finding in result.findings if "stands at the border of the box" in finding]
    assert said
    assert any("what goes along with it counts as weak" in finding for finding in said)


def test_widened_search_resumes_to_the_same_end(recording):
    states = []
    whole = run(recording, CONFIG, report=lambda now: states.append(now.state))
    late = states[-2]
    assert late["box"] != states[0]["box"]
    assert run(recording, CONFIG, resume=late) == whole
    with pytest.raises(IdentificationCancelledError) as stopped:
        run(recording, CONFIG, is_cancelled=lambda: True)
    assert run(recording, CONFIG, resume=stopped.value.state) == whole


def test_search_never_takes_more_steps_than_were_asked_for(recording):
    result = run(recording, CONFIG.model_copy(update={"descents": 5}))
    assert len(result.convergence) == 5


def test_what_physics_holds_to_a_sign_keeps_it(recording):
    problem = problem_from(MINIGLIDER, recording, CONFIG)
    names = [unknown.name for unknown in problem.sought]
    drag, damping = names.index("drag_0"), names.index("pitch_damping_m_s")
    lift = names.index("lift_0")
    for _ in range(20):
        u = np.zeros(len(names))
        u[drag], u[damping] = problem.low[drag], problem.high[damping]
        u[lift] = problem.low[lift]
        wider = widened(problem, u)
        if wider is None:
            break
        problem = wider
    sought = problem.sought
    assert wider is None
    assert 0.0 < sought[drag].value(sought[drag].low) < 0.03 * sought[drag].nominal
    assert 0.03 * sought[damping].nominal < sought[damping].value(sought[damping].high) < 0.0
    assert sought[lift].low == -CONFIG.widest_share
    assert at_border(sought, u) == tuple(sorted((drag, damping, lift)))


def named(name: str) -> Unknown:
    return Unknown(name, name, "", 1.0, 1.0, -0.5, 0.5, 0)


def test_only_what_goes_along_with_the_border_is_doubted():
    # a and b are seen together, c by itself; a wants to leave the box
    one = 1e5 * np.array([[1.0, 0.8, 0.0], [0.8, 1.0, 0.0], [0.0, 0.0, 1.0]])
    fishers = np.array([one] * 6)
    pulls = np.array([[-100.0, 0.0, 0.0]] * 6)
    told = Information(fishers.sum(axis=0), pulls.sum(axis=0), fishers, pulls)
    sought = (named("a"), named("b"), named("c"))
    inside, _ = judge(sought, np.zeros(3), told, 1.0)
    border, _ = judge(sought, np.array([0.5, 0.0, 0.0]), told, 1.0)
    assert [one.verdict for one in inside] == ["identified"] * 3
    assert [one.verdict for one in border] == ["weak", "weak", "identified"]
    assert border[1].held_by == (0,)
    assert "goes along with a, which stands at the border" in border[1].reason
    assert border[1].std > inside[1].std
