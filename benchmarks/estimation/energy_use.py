"""Whether the 90 % interval of a plan's energy holds what it takes, by what past dives taught.

Worlds are drawn when this runs: powers about the model's by the spread that is believed of it, a
scatter of 8 % from dive to dive, readings of one dive in ten wrong by two to six times. After one
to three dives such a reading cannot be told from a robot that the model is wrong about: those rows
have no bar.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np

from tests.autonomy.test_energy_use import dive, drawn, flown, hidden_powers

WORLDS = 1000
LEAST_HELD, MOST_HELD = 0.85, 0.95
DIVES = (0, 1, 3, 8, 15, 40)
UNTELLABLE = (1, 3)
SCATTER = 0.08
WRONG = 0.1


def measure() -> list[dict[str, Any]]:
    return list(coverage(int(np.random.default_rng().integers(2**32))))


def coverage(seed: int, worlds: int = WORLDS) -> Iterator[dict[str, Any]]:
    """Hold intervals of the next plan of four dives against what it takes.

    Args:
        seed: Decides all draws; it is told with the result.
        worlds: How many robots for each number of dives.
    """
    for dives in DIVES:
        rng = np.random.default_rng([seed, dives])
        held, width, error = 0, 0.0, 0.0
        for _ in range(worlds):
            power_w = hidden_powers(rng)
            use = flown(rng, power_w, dives=dives, scatter=SCATTER, outliers=WRONG)
            plan = [dive(rng) for _ in range(4)]
            truth = sum(drawn(rng, one, power_w, SCATTER) for one in plan)
            said = use.energy(np.sum(plan, axis=0), pieces=len(plan))
            held += said.low_wh <= truth <= said.high_wh
            width += (said.high_wh - said.low_wh) / (2.0 * truth * worlds)
            error += abs(said.mean_wh - truth) / (truth * worlds)
        share = held / worlds
        is_judged = dives not in UNTELLABLE
        yield {
            "area": "energy_use",
            "name": (
                f"Plans within their 90 % energy after {dives} dives (half width {width:.0%}, "
                f"mean error {error:.0%}, seed {seed})"
            ),
            "value": share,
            "unit": "",
            "bar": LEAST_HELD if is_judged else None,
            "met": LEAST_HELD <= share <= MOST_HELD if is_judged else None,
        }
