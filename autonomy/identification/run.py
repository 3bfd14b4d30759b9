"""Runs an identification from its beginning or a checkpoint to a result."""

import hashlib
from dataclasses import replace
from typing import Any

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.identification import least_squares, swarm
from autonomy.identification.config import IdentificationConfig
from autonomy.identification.identifiability import judge
from autonomy.identification.least_squares import Descent, DivergedError
from autonomy.identification.problem import Problem, Workers
from autonomy.identification.progress import (
    Checkpoint,
    CheckpointError,
    IdentificationCancelledError,
    IsCancelled,
    Progress,
    Report,
)
from autonomy.identification.result import (
    IdentificationResult,
    estimates,
    findings,
    fit_of,
    identified_vehicle,
)
from autonomy.identification.swarm import Swarm

_FORMAT = 1


def identify(
    problem: Problem,
    config: IdentificationConfig,
    rng: np.random.Generator,
    *,
    report: Report,
    is_cancelled: IsCancelled,
    resume: Checkpoint | None = None,
    threads: int = 2,
) -> IdentificationResult:
    """Find the parameters that explain a recording best.

    The same problem, configuration and generator give the same result, whatever the number of
    threads and however often it was stopped and resumed.

    Args:
        problem: From ``problem_from`` with the same configuration.
        config: Method and its settings.
        rng: Source of randomness; one number is drawn.
        report: Called after each move of the swarm and each step of the descent.
        is_cancelled: Asked as often.
        resume: State of an earlier report of the same identification.
        threads: How many candidates are simulated at once.

    Raises:
        IdentificationCancelledError: With the state to resume from.
        CheckpointError: If ``resume`` belongs to another problem.
        DivergedError: If no candidate can follow the recording.
    """
    problem = replace(problem, config=config)
    log = _Log(problem, report, is_cancelled)
    seed = int(rng.integers(2**31))
    if resume is not None:
        log.read(resume)
    with Workers(threads) as workers:
        if config.method == "swarm":
            point = _swarm(problem, seed, log, resume, workers)
        else:
            point = _descent(problem, np.zeros(len(problem.sought)), None, log, resume, workers)
        return _result(problem, point, log, workers)


class _Log:
    """Keeps the convergence and makes checkpoints of it."""

    def __init__(self, problem: Problem, report: Report, is_cancelled: IsCancelled) -> None:
        config = problem.config
        self.convergence: list[tuple[int, float]] = []
        self._moves = config.iterations * config.runs if config.method == "swarm" else 0
        descends = config.polish or config.method == "least_squares"
        self._all = self._moves + (config.descents if descends else 0)
        self._fingerprint = fingerprint(problem)
        self._report = report
        self._is_cancelled = is_cancelled
        self._problem = problem

    def read(self, state: Checkpoint) -> None:
        """Take over what an earlier part of the same identification noted."""
        if state.get("format") != _FORMAT or state.get("fingerprint") != self._fingerprint:
            raise CheckpointError(
                "the checkpoint is of another recording, vehicle or configuration"
            )
        self.convergence = [(int(k), float(cost)) for k, cost in state["convergence"]]

    def moved(self, now: Swarm) -> None:
        """Note a move of the swarm."""
        done = now.run * self._problem.config.iterations + now.iteration
        spread = now.spread(self._problem)
        self._note(done, now.cost, spread, "the swarm searches", {"swarm": now.document()})

    def descended(self, now: Descent) -> None:
        """Note a step of the descent."""
        state = {"descent": now.document()}
        self._note(self._moves + now.steps, now.cost, 0.0, "least squares descend", state)

    def _note(
        self, done: int, cost: float, spread: float, message: str, stage: dict[str, Any]
    ) -> None:
        self.convergence.append((done, cost))
        state: Checkpoint = {
            "format": _FORMAT,
            "fingerprint": self._fingerprint,
            "convergence": [list(entry) for entry in self.convergence],
            **stage,
        }
        self._report(Progress(done, self._all, cost, spread, message, state))
        if self._is_cancelled():
            raise IdentificationCancelledError(state)


def fingerprint(problem: Problem) -> str:
    """Return a digest of all that the course of an identification depends on."""
    digest = hashlib.sha256(problem.config.model_dump_json().encode())
    digest.update(repr(problem.sought).encode())
    layout = problem.layout
    for array in (
        problem.vehicle.packed(),
        *layout.nodes,
        layout.measured,
        layout.weight,
        problem.guess,
    ):
        digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()


def _swarm(
    problem: Problem, seed: int, log: _Log, resume: Checkpoint | None, workers: Workers
) -> Descent:
    """Search, and then polish if that is wanted."""
    if resume is not None and "descent" in resume:
        return _descent(problem, None, None, log, resume, workers)
    if resume is not None:
        start = Swarm.from_document(resume["swarm"])
    else:
        start = swarm.begin(problem, seed, workers)
    found = swarm.search(problem, start, workers, log.moved)
    if problem.config.polish:
        return _descent(problem, found.u, found.u_initial, log, None, workers)
    return _settled(problem, found.u, found.u_initial, workers)


def _descent(
    problem: Problem,
    u: FloatArray | None,
    initial: FloatArray | None,
    log: _Log,
    resume: Checkpoint | None,
    workers: Workers,
) -> Descent:
    if resume is not None:
        start = Descent.from_document(resume["descent"])
    elif initial is None or u is None:
        start = least_squares.begin(problem, np.zeros(len(problem.sought)), workers)
    else:
        start = _settled(problem, u, initial, workers)
    return least_squares.descend(problem, start, workers, log.descended)


def _settled(problem: Problem, u: FloatArray, initial: FloatArray, workers: Workers) -> Descent:
    """Return a point with the initial states that fit it best."""
    for start in (initial, problem.guess):
        found = least_squares.settled(problem, u, start, workers)
        if found is not None:
            return least_squares.at(problem, u, found, workers)
    raise DivergedError(
        "no candidate of the swarm can follow the recording: widen the box, take more particles,"
        " or check the vehicle"
    )


def _result(problem: Problem, point: Descent, log: _Log, workers: Workers) -> IdentificationResult:
    equations = least_squares.normal_equations(problem, point.u, point.initial, workers)
    if equations is None:
        raise DivergedError("the model cannot follow the recording at the point that was found")
    info = least_squares.information(equations)
    judged, directions = judge(problem.sought, point.u, info, point.cost)
    cost_before, before = _before(problem, workers)
    after, _ = problem.simulate(point.u[None], point.initial[None], workers)
    return IdentificationResult(
        problem.config.method,
        identified_vehicle(problem, point.u, point.cost),
        cost_before,
        point.cost,
        tuple(log.convergence),
        estimates(problem, point.u, judged),
        findings(directions),
        fit_of(problem, before, after[0]),
        problem.report,
    )


def _before(problem: Problem, workers: Workers) -> tuple[float | None, FloatArray | None]:
    """Return cost and prediction of the present parameters, as far as they can follow."""
    present = np.zeros(len(problem.sought))
    initial = least_squares.settled(problem, present, problem.guess, workers)
    if initial is None:
        return None, None
    predicted, _ = problem.simulate(present[None], initial[None], workers)
    return least_squares.at(problem, present, initial, workers).cost, predicted[0]
