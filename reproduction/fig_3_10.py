"""Thesis Figure 3.10: oscillations of pitch, and how slow or late the mass must be for them."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.whatif.config import TABLE_3_3_DIAGONAL
from autonomy.whatif.run import Trial
from reproduction.contender import CONTENDERS
from reproduction.result import (
    Figure,
    Hue,
    Mark,
    Panel,
    Report,
    Reproduction,
    Row,
    Series,
)
from reproduction.table_3_3 import OSCILLATION_RAD, TRIALS
from reproduction.trials import Job, run_jobs, with_actuator

RATE_SHARES = (1.0, 0.5, 0.25)
DELAYS_S = (0.0, 0.1, 0.2, 0.4)
EXAMPLE = (0.25, 0.0)
"""Rate and delay of the trial that the figure shows."""
_HORIZONTAL, _PITCH = 1, 2
_MM = 1e3


@dataclass(frozen=True, slots=True, eq=False)
class Sweep:
    """Trials on the diagonal with every kind of sliding mass."""

    rms: FloatArray
    """Errors of each trial, shape ``(rates, delays, 3 controllers, trials, 4)``."""
    example: Trial
    """First trial of the PID with the example's mass."""

    def mean(self, error: int) -> FloatArray:
        """Return the mean over the trials of one error, shape ``(rates, delays, 3)``."""
        return self.rms[..., error].mean(axis=-1)

    def oscillating(self) -> FloatArray:
        """Return how many trials oscillate, shape ``(rates, delays, 3)``."""
        return (self.rms[..., _PITCH] > OSCILLATION_RAD).sum(axis=-1).astype(np.float64)


def sweep(
    seed: int,
    report: Report,
    *,
    rate_shares: tuple[float, ...] = RATE_SHARES,
    delays_s: tuple[float, ...] = DELAYS_S,
    trials: int = TRIALS,
) -> Sweep:
    """Run the diagonal of Eq. 3.21 with noise, for each rate, delay, controller and seed."""
    masses = [(rate, delay) for rate in rate_shares for delay in delays_s]
    jobs = [
        Job(with_actuator(TABLE_3_3_DIAGONAL, *mass), contender, contender.experiment, seed + n)
        for mass in masses
        for contender in CONTENDERS
        for n in range(trials)
    ]
    done = run_jobs(jobs, report)
    shape = (len(rate_shares), len(delays_s), len(CONTENDERS), trials, 4)
    example = masses.index(EXAMPLE) * len(CONTENDERS) * trials + 2 * trials
    return Sweep(np.array([trial.rms() for trial in done]).reshape(shape), done[example])


def reproduce(seed: int, report: Report) -> Reproduction:
    """Run the sweep, and show one trial in which the PID oscillates."""
    result = sweep(seed, report, trials=TRIALS)
    quantities = (
        ("pitch error, mean RMS", result.mean(_PITCH), "rad"),
        ("horizontal error, mean RMS", result.mean(_HORIZONTAL), "m"),
        ("pitch oscillates", result.oscillating(), f"of {TRIALS}"),
    )
    return Reproduction(
        name="fig-3.10",
        title="Thesis Figure 3.10: oscillations of pitch with a slow or late sliding mass",
        scenario=_scenario(seed),
        rows=tuple(
            Row(
                f"{title}: speed x{rate:g}, {delay:g} s late",
                contender.title,
                float(values[i, j, k]),
                None,
                unit,
            )
            for title, values, unit in quantities
            for i, rate in enumerate(RATE_SHARES)
            for j, delay in enumerate(DELAYS_S)
            for k, contender in enumerate(CONTENDERS)
        ),
        figure=_figure(result),
        notes=(
            "The thesis shows one trial of the robot and prints neither speed nor delay of its "
            "actuator under load.",
            "A slow mass makes the PID oscillate and leaves the backstepping controllers alone. A "
            "late one does the opposite: at nominal speed, 0.2 s disturb them and not the PID.",
            "A mean pitch error above 1 rad is a robot whose pitch ran past the vertical.",
        ),
    )


def _scenario(seed: int) -> dict[str, object]:
    return {
        "thesis": "section 3.4.4, Figure 3.10 (a robot in a tank)",
        "trials": f"{TRIALS} of each controller and mass on the diagonal of table-3.3, same seeds",
        "mass": "greatest speed as a share of 12.5 mm/s, and time until it answers",
        "oscillates": f"RMS pitch error above {OSCILLATION_RAD} rad",
        "seed": seed,
        "gains": {one.title: one.experiment.model_dump(mode="json") for one in CONTENDERS},
        "scenario": TABLE_3_3_DIAGONAL.model_dump(mode="json"),
    }


def _figure(result: Sweep) -> Figure:
    panels = [
        _curves(f"pitch error, speed x{rate:g}", "mean RMS (rad)", result.mean(_PITCH)[i], "y")
        for i, rate in enumerate(RATE_SHARES)
    ]
    panels.append(
        _curves("horizontal error, speed x0.25", "mean RMS (m)", result.mean(_HORIZONTAL)[2], "")
    )
    trial = result.example
    reached = Series("PID", trial.time_s, _MM * trial.inputs[:, 1], Hue.PID)
    asked = Series("asked for", trial.time_s, _MM * trial.commands[:, 1], Hue.FAINT, Mark.THIN)
    pitch = Series("PID", trial.time_s, np.degrees(trial.state[:, 4]), Hue.PID)
    wanted = Series("reference", trial.time_s, np.degrees(trial.reference[:, 3]), Hue.REFERENCE)
    words = f"speed x{EXAMPLE[0]:g}"
    panels += [
        Panel(f"sliding mass, {words}", "time (s)", "position (mm)", (asked, reached)),
        Panel(f"pitch, {words}", "time (s)", "pitch (deg)", (pitch, wanted)),
    ]
    return Figure(tuple(panels), 2, "Below: first trial of the PID.")


def _curves(title: str, y_label: str, values: FloatArray, logarithmic: Literal["", "y"]) -> Panel:
    lines = tuple(
        Series(contender.title, np.array(DELAYS_S), values[:, k], contender.hue)
        for k, contender in enumerate(CONTENDERS)
    )
    return Panel(title, "delay of the mass (s)", y_label, lines, logarithmic=logarithmic)
