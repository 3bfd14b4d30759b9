"""Runs an identification from its beginning or a checkpoint to a result."""

import hashlib
from dataclasses import replace
from typing import Any

import numpy as np

from autonomy import campaign
from autonomy.arrays import FloatArray
from autonomy.identification import box, kernel, least_squares, screening, swarm
from autonomy.identification.conclusion import concluded
from autonomy.identification.config import IdentificationConfig
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
from autonomy.identification.result import IdentificationResult
from autonomy.identification.swarm import Swarm

_FORMAT = 3
_STALLED, _STALLED_STEPS = 0.98, 3
"""A step that leaves more of the cost than this gains little; asked from so many steps on."""
_SCREENED_EVERY = 12
"""Steps of the descent between two looks at what spoils it."""


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
        ClusterError: If the cluster that ``autonomy.campaign`` is told of cannot be used.
    """
    problem = replace(problem, config=config)
    log = _Log(problem, report, is_cancelled)
    seed = int(rng.integers(2**31))
    if resume is not None:
        log.read(resume)
    with campaign.opened() as spread, Workers(threads, _cluster(spread)) as workers:
        if config.method == "swarm":
            fit, point = _swarm(problem, seed, log, resume, workers)
        else:
            fit, point = _descent(problem, None, log, resume, workers)
        return concluded(fit, point, tuple(log.convergence), workers)


def _cluster(spread: campaign.Spread) -> campaign.Cluster | None:
    return spread if isinstance(spread, campaign.Cluster) else None


class _Log:
    """Keeps the convergence and makes checkpoints of it."""

    def __init__(self, problem: Problem, report: Report, is_cancelled: IsCancelled) -> None:
        config = problem.config
        self.cuts: tuple[screening.Cut, ...] = ()
        """Parts of the segments that the descent uses."""
        self.box = box.borders(problem)
        """Borders of the box that the descent keeps to."""
        self.widened_at = 0
        """Step of the descent at which the box grew last."""
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
        said = f"the swarm searches: move {done} of {self._moves}, cost {_rounded(now.cost)}"
        self._note(done, now.cost, spread, said, {"swarm": now.document()})

    def descended(self, now: Descent) -> None:
        """Note a step of the descent."""
        state = {
            "descent": now.document(),
            "cuts": [list(cut) for cut in self.cuts],
            "box": self.box,
            "widened_at": self.widened_at,
        }
        said = f"least squares descend: step {now.steps}, cost {_rounded(now.cost)}"
        if self.box != box.borders(self._problem):
            said += ", in a wider box"
        self._note(self._moves + now.steps, now.cost, 0.0, said, state)

    def has_stalled(self, now: Descent) -> bool:
        """Tell whether the descent has gained little by its last step in this box."""
        if now.steps - self.widened_at < _STALLED_STEPS:
            return False
        return self.convergence[-1][1] > _STALLED * self.convergence[-2][1]

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


def _rounded(cost: float) -> str:
    """Return a cost as it is read: what diverged has none."""
    return f"{cost:.3g}" if cost < kernel.DIVERGED else "none yet"


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
) -> tuple[Problem, Descent]:
    """Search, and then polish if that is wanted; return the fit to what was used, and its point."""
    if resume is not None and "descent" in resume:
        return _descent(problem, None, log, resume, workers)
    if resume is not None:
        start = Swarm.from_document(resume["swarm"])
    else:
        start = swarm.begin(problem, seed, workers)
    found = swarm.search(problem, start, workers, log.moved)
    point = _settled(problem, found.u, found.u_initial, workers)
    if problem.config.polish:
        return _descent(problem, point, log, None, workers)
    return problem, point


def _descent(
    problem: Problem,
    start: Descent | None,
    log: _Log,
    resume: Checkpoint | None,
    workers: Workers,
) -> tuple[Problem, Descent]:
    """Descend, and leave out what the model cannot explain on the way."""
    fit, log.cuts = problem, screening.whole(problem)
    if resume is not None:
        problem, log.box = box.with_borders(problem, resume["box"]), resume["box"]
        log.widened_at = int(resume["widened_at"])
        log.cuts = tuple((int(k), int(first), int(stop)) for k, first, stop in resume["cuts"])
        fit = screening.reduced(problem, log.cuts)
        point = Descent.from_document(resume["descent"])
    elif start is not None:
        point = start
    else:
        point = least_squares.begin(problem, np.zeros(len(problem.sought)), workers)
    while True:
        # a model that presses against the box explains nothing: first the box, then the screening
        if (point.is_done or log.has_stalled(point)) and point.steps < problem.config.descents:
            wider = box.widened(problem, point.u)
            if wider is not None:
                problem, log.box, log.widened_at = wider, box.borders(wider), point.steps
                whole = screening.whole(problem)
                fit = problem
                point = (
                    least_squares.at(fit, point.u, point.initial, workers, steps=point.steps)
                    if log.cuts == whole
                    else screening.carried(log.cuts, whole, fit, point, workers)
                )
                log.cuts = whole
                continue
        # by the number of steps, so that a resumed descent looks at the same points
        if point.is_done or (point.steps and point.steps % _SCREENED_EVERY == 0):
            kept = screening.screened(fit, log.cuts, point, workers)
            if kept != log.cuts:
                fit = screening.reduced(problem, kept)
                point = screening.carried(log.cuts, kept, fit, point, workers)
                log.cuts = kept
                continue
        if point.is_done or point.steps >= problem.config.descents:
            return fit, point
        point = least_squares.stepped(fit, point, workers)
        log.descended(point)


def _settled(problem: Problem, u: FloatArray, initial: FloatArray, workers: Workers) -> Descent:
    """Return a point with the initial states that fit it best."""
    found = least_squares.best_settled(problem, u, (initial, problem.guess), workers)
    if found is None:
        raise DivergedError(
            "no candidate of the swarm can follow the recording: widen the box, take more"
            " particles, or check the vehicle"
        )
    return least_squares.at(problem, u, found, workers)
