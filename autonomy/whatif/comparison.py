"""Several controllers in one scenario on the same seeds, side by side."""

from collections.abc import Callable, Sequence
from contextlib import nullcontext
from dataclasses import dataclass

import numpy as np

from autonomy import campaign
from autonomy.arrays import FloatArray, IntArray, evenly_spread
from autonomy.campaign import Spread
from autonomy.current.table import FlowTable
from autonomy.result import Result
from autonomy.vehicle.config import Vehicle
from autonomy.whatif.config import ControllerChoice, TrialConfig
from autonomy.whatif.result import (
    ComparedRun,
    ComparisonResult,
    ErrorBands,
    Inputs,
    RunSummary,
    Track,
    TrackErrors,
    Travel,
)
from autonomy.whatif.run import Trial, fly
from autonomy.whatif.setting import packed_references
from autonomy.whatif.work import check_work

_BAND = (0.05, 0.95)
"""Quantiles over the seeds: 90 % of the runs lie between."""
MOST_POINTS = 400
"""Moments that are kept of each run: 65 kB, whatever the length of the trial."""


@dataclass(frozen=True, slots=True, eq=False)
class KeptRun:
    """What a comparison keeps of one trial, so that many of them fit in memory."""

    seed: int
    time_s: FloatArray
    """At most ``MOST_POINTS`` moments, evenly spread, first and last included, shape ``(n,)``."""
    state: FloatArray
    """The true 12 states at these moments, shape ``(n, 12)``."""
    inputs: FloatArray
    """Where the actuators were, kg, m, rad, shape ``(n, 3)``."""
    errors: FloatArray
    """Depth, horizontal, pitch and hybrid error, shape ``(n, 4)``."""
    rms: FloatArray
    """Root mean square of each error at all commands, shape ``(4,)``."""
    travel: FloatArray
    """Way of each actuator, kg, m, rad, shape ``(3,)``."""
    energy_j: float


@dataclass(frozen=True, slots=True, eq=False)
class ControllerResult:
    """Every run of one controller."""

    choice: ControllerChoice
    runs: tuple[KeptRun, ...]
    """One a seed, in the order of the seeds."""

    @property
    def rms(self) -> FloatArray:
        """Root mean square of depth, horizontal, pitch and hybrid error, shape ``(seeds, 4)``."""
        return np.array([run.rms for run in self.runs])

    @property
    def shown(self) -> KeptRun:
        """The run whose horizontal error is the median one."""
        order = np.argsort(self.rms[:, 1], kind="stable")
        return self.runs[int(order[(len(order) - 1) // 2])]

    def summary(self) -> RunSummary:
        """Medians over the seeds."""
        depth, horizontal, pitch, hybrid = np.median(self.rms, axis=0)
        m0_kg, rp1_m, delta_rad = np.median([run.travel for run in self.runs], axis=0)
        return RunSummary(
            depth_rms_m=depth,
            horizontal_rms_m=horizontal,
            horizontal_end_m=np.median([run.errors[-1, 1] for run in self.runs]),
            pitch_rms_rad=pitch,
            hybrid_rms_rad=hybrid,
            travel=Travel(m0_kg=m0_kg, rp1_m=rp1_m, delta_rad=delta_rad),
            energy_j=np.median([run.energy_j for run in self.runs]),
        )


@dataclass(frozen=True, slots=True, eq=False)
class Comparison:
    """Runs of every controller on the same seeds."""

    vehicle: Vehicle
    config: TrialConfig
    reference: FloatArray
    """Packed reference at the moments that are kept of each run, shape ``(n, 12)``."""
    results: tuple[ControllerResult, ...]

    def result(self, max_points: int = MOST_POINTS) -> ComparisonResult:
        """Return what a page draws.

        Args:
            max_points: At most so many moments, and no more than are kept, evenly spread, the
                last one included.
        """
        time_s = self.results[0].runs[0].time_s
        at = evenly_spread(len(time_s), max_points)
        return ComparisonResult(
            time_s=time_s[at].tolist(),
            reference=Track.model_validate(_columns(Track, self.reference[at])),
            runs=[_compared_run(result, at) for result in self.results],
            seeds=list(self.config.seeds),
            vehicle=self.vehicle.key,
            note=self.vehicle.note,
        )


def compare(
    vehicle: Vehicle,
    config: TrialConfig,
    choices: Sequence[ControllerChoice],
    *,
    flow: FlowTable | None = None,
    report: Callable[[float, str], None] = lambda _share, _message: None,
    is_cancelled: Callable[[], bool] = lambda: False,
    spread: Spread | None = None,
) -> Comparison:
    """Run every controller on every seed of a scenario, many at once.

    Args:
        vehicle: The robot, as the controllers believe it to be.
        config: The scenario.
        choices: The controllers.
        flow: The current by place, depth and time; that of the scenario by default.
        report: Told the share that is done and what is being done, in the caller's thread.
        is_cancelled: Asked between runs.
        spread: Where they are run, by default as ``autonomy.campaign`` is told; the result does
            not depend on it.

    Raises:
        ValueError: If there is no controller.
        TooMuchWorkError: If it takes more steps than are worked out.
        CampaignCancelledError: If it was cancelled.
        ClusterError: If the cluster that is named cannot be used.
        NoSteadyGlideError: If the reference is a glide flatter than the vehicle can glide.
    """
    if not choices:
        raise ValueError("a comparison needs at least one controller")
    check_work(vehicle, config, choices)
    references = packed_references(vehicle, config)
    at = evenly_spread(len(references), MOST_POINTS)
    runs = [(choice, seed) for seed in config.seeds for choice in choices]

    def tell(done: int) -> None:
        report(done / len(runs), f"{done} of {len(runs)} runs")

    common = (vehicle, config, references, flow, at)
    with nullcontext(spread) if spread is not None else campaign.opened() as where:
        kept = where.run(_fly_and_keep, common, runs, on_done=tell, is_cancelled=is_cancelled)
    results = tuple(
        ControllerResult(choice, tuple(kept[place :: len(choices)]))
        for place, choice in enumerate(choices)
    )
    return Comparison(vehicle, config, references[at], results)


def _fly_and_keep(
    common: tuple[Vehicle, TrialConfig, FloatArray, FlowTable | None, IntArray],
    run: tuple[ControllerChoice, int],
) -> KeptRun:
    vehicle, config, references, flow, at = common
    return _kept(fly(vehicle, config, *run, references, flow), at)


def _kept(trial: Trial, at: IntArray) -> KeptRun:
    return KeptRun(
        seed=trial.seed,
        time_s=trial.time_s[at],
        state=trial.state[at],
        inputs=trial.inputs[at],
        errors=trial.errors[at],
        rms=trial.rms(),
        travel=trial.travel,
        energy_j=trial.energy_j,
    )


def _compared_run(result: ControllerResult, at: IntArray) -> ComparedRun:
    shown = result.shown
    errors = np.array([run.errors[at] for run in result.runs])
    middle = np.median(errors, axis=0)
    low, high = np.quantile(errors, _BAND, axis=0)
    return ComparedRun.model_validate(
        {
            "kind": result.choice.kind,
            "title": result.choice.title,
            **_columns(Track, shown.state[at][:, [0, 1, 2, 4]]),
            "errors": _columns(TrackErrors, middle),
            "band": {
                name: {"low": low[:, i].tolist(), "high": high[:, i].tolist()}
                for i, name in enumerate(ErrorBands.model_fields)
            },
            "inputs": _columns(Inputs, shown.inputs[at]),
            "summary": result.summary(),
        }
    )


def _columns(model: type[Result], table: FloatArray) -> dict[str, list[float]]:
    """Name the columns of a table by the first fields of a model."""
    columns = table.T.tolist()
    return dict(zip(model.model_fields, columns, strict=False))
