"""Runs the trials behind a reproduction."""

from collections.abc import Sequence
from dataclasses import dataclass

from autonomy import campaign
from autonomy.arrays import FloatArray
from autonomy.vehicle.config import MINIGLIDER, Vehicle
from autonomy.whatif import kernel
from autonomy.whatif.config import ControllerChoice, TrialConfig
from autonomy.whatif.run import Trial, fly
from autonomy.whatif.setting import packed_references
from reproduction.contender import Contender, Gains
from reproduction.result import Report

ERRORS = (
    ("depth error", "m"),
    ("horizontal error", "m"),
    ("pitch error", "rad"),
    ("hybrid error", "rad"),
)
"""What ``Trial.errors`` holds, column by column, and its unit."""


@dataclass(frozen=True, slots=True, eq=False)
class Job:
    """One trial to run."""

    scenario: TrialConfig
    contender: Contender
    gains: Gains
    seed: int
    noise: FloatArray | None = None
    """What is sensed is off by this, shape ``(n, 9)``; by default as the scenario draws it."""


def run_jobs(jobs: Sequence[Job], report: Report) -> list[Trial]:
    """Run trials of the Miniglider on every core or machine; return them in the jobs' order."""
    report(0.0, "compiling")
    kernel.warm_up()

    def tell(done: int) -> None:
        report(done / len(jobs), f"trial {done} of {len(jobs)}")

    with campaign.opened() as spread:
        return spread.run(_run, MINIGLIDER, jobs, on_done=tell)


def with_actuator(scenario: TrialConfig, rate_share: float, delay_s: float) -> TrialConfig:
    """Return a scenario with another sliding mass.

    Args:
        scenario: The trial.
        rate_share: Its greatest speed as a share of the nominal one.
        delay_s: How late it answers.
    """
    disturbance = scenario.disturbance.model_copy(
        update={"actuator_rate_share": rate_share, "actuator_delay_s": delay_s}
    )
    return scenario.model_copy(update={"disturbance": disturbance})


def _run(vehicle: Vehicle, job: Job) -> Trial:
    choice = ControllerChoice(job.contender.kind, job.contender.title, job.gains)
    references = packed_references(vehicle, job.scenario)
    return fly(vehicle, job.scenario, choice, job.seed, references, noise=job.noise)
