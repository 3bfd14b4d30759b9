"""Compiled bank of guesses how fast and how late an actuator follows its commands.

Each guess is a rate and a delay, and moves an actuator of its own under the commands that were
sent. The farther it stands from what the true one feeds back, the less is thought of it. What is
thought is bounded below, so that an actuator that changes is believed again soon, and commands that
tell no two guesses apart change nothing.
"""

import math

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.compiled import inner_kernel, kernel

RATES, DELAYS = 21, 17
RATE_FIRST, RATE_RATIO = 0.0625, 2.0**0.25
"""The slowest guess as a share of the nominal rate, and the ratio of one guess to the next."""
DELAY_STEP_S = 0.1
GUESSES = RATES * DELAYS
HISTORY = 256
PERIOD_S = 0.1
"""Least time between two looks."""
_TOLERANCE = 0.01
"""Distance that means nothing, as a share of the actuator's travel."""
_GROSS = 5.0
"""Distances beyond so many tolerances count no more: one wrong reading decides nothing."""
_ALIKE_S = 1.0
"""Time for which a distance says the same again."""
_MOST_AGAINST = 20.0
"""Least thought of a guess, in nats below the best."""
REFUTED = 5.0
"""What was told is not believed from here on, in nats."""
UNCLEAR_OCTAVES = 0.5
"""A rate whose logarithm is known no better than this is hardly known."""

HEAD, SENT_COUNT, SINCE_S, LOG_RATE, LOG_RATE_STD, DELAY_S, DELAY_STD, TOLD_AGAINST = range(8)
"""Index of each number at the head of a bank: place of the newest command and how many were sent;
time since the last look; the mean of the guesses (logarithm to base 2 of the share of the nominal
rate, and delay) with its standard deviation; and what speaks against what was told, nats."""
PLACE = 8
AGAINST = PLACE + GUESSES
COMMANDS = AGAINST + GUESSES
BANK_SIZE = COMMANDS + HISTORY


@inner_kernel
def guess_of(share: float) -> int:
    """Return the number of the guess next to a share of the nominal rate."""
    place = math.log2(max(share, 1e-3) / RATE_FIRST) / math.log2(RATE_RATIO)
    return min(max(round(place), 0), RATES - 1)


@inner_kernel
def look(
    bank: FloatArray,
    at: int,
    command: float,
    feedback: float,
    rate: float,
    travel: float,
    told_share: float,
    told_delay_s: float,
    dt_s: float,
) -> None:
    """Take in what an actuator was told, and where it stood ``dt_s`` later.

    Args:
        bank: Memory of the guesses; changed in place.
        at: Where the bank begins in it; ``BANK_SIZE`` numbers, all 0 for a fresh start.
        command: Set point that was sent one call before, inside the end stops.
        feedback: Where the actuator says that it is now.
        rate: Its nominal rate, per second.
        travel: Way from one end stop to the other.
        told_share: Share of the nominal rate that is believed until something speaks against it.
        told_delay_s: Delay that is believed likewise.
        dt_s: Time since the last call.
    """
    if not (math.isfinite(command) and math.isfinite(feedback)) or dt_s <= 0.0:
        return
    if bank[at + SENT_COUNT] == 0.0:
        for i in range(GUESSES):
            bank[at + PLACE + i] = feedback
    bank[at + SINCE_S] += dt_s
    if bank[at + SINCE_S] < 0.999 * PERIOD_S and bank[at + SENT_COUNT] > 0.0:
        return
    passed_s = bank[at + SINCE_S]
    bank[at + SINCE_S] = 0.0
    head = (int(bank[at + HEAD]) + 1) % HISTORY
    bank[at + HEAD] = head
    bank[at + COMMANDS + head] = command
    count = min(bank[at + SENT_COUNT] + 1.0, 1e9)
    bank[at + SENT_COUNT] = count
    told_rate = guess_of(told_share)
    told_delay = min(max(round(told_delay_s / DELAY_STEP_S), 0), DELAYS - 1)
    least = math.inf
    weight = min(passed_s / _ALIKE_S, 1.0)
    for d in range(DELAYS):
        late = round(d * DELAY_STEP_S / passed_s)
        if late >= count:
            late = int(count) - 1
        target = bank[at + COMMANDS + (head - min(late, HISTORY - 1)) % HISTORY]
        share = RATE_FIRST
        for r in range(RATES):
            i = d * RATES + r
            place = bank[at + PLACE + i]
            most = share * rate * passed_s
            place += min(max(target - place, -most), most)
            bank[at + PLACE + i] = place
            off = min(abs(feedback - place) / (_TOLERANCE * travel), _GROSS)
            bank[at + AGAINST + i] += 0.5 * weight * off * off
            least = min(least, bank[at + AGAINST + i])
            share *= RATE_RATIO
    _sum_up(bank, at, least)
    bank[at + TOLD_AGAINST] = bank[at + AGAINST + told_delay * RATES + told_rate]


@inner_kernel
def _sum_up(bank: FloatArray, at: int, least: float) -> None:
    """Bound what speaks against the guesses, and write their mean and deviation."""
    total = rate = rate_2 = delay = delay_2 = 0.0
    for d in range(DELAYS):
        for r in range(RATES):
            i = at + AGAINST + d * RATES + r
            bank[i] = min(bank[i] - least, _MOST_AGAINST)
            if bank[i] == _MOST_AGAINST:
                continue
            w = math.exp(-bank[i])
            total += w
            rate += w * r
            rate_2 += w * r * r
            delay += w * d
            delay_2 += w * d * d
    rate /= total
    delay /= total
    octaves = math.log2(RATE_RATIO)
    bank[at + LOG_RATE] = math.log2(RATE_FIRST) + octaves * rate
    bank[at + LOG_RATE_STD] = octaves * math.sqrt(max(rate_2 / total - rate * rate, 0.0))
    bank[at + DELAY_S] = DELAY_STEP_S * delay
    bank[at + DELAY_STD] = DELAY_STEP_S * math.sqrt(max(delay_2 / total - delay * delay, 0.0))


@kernel
def known_rate(bank: FloatArray, at: int, told_share: float) -> float:
    """Return the share of the nominal rate to count on; the told one where nothing refutes it."""
    if bank[at + TOLD_AGAINST] <= REFUTED:
        return told_share
    if bank[at + LOG_RATE_STD] > UNCLEAR_OCTAVES:
        # no command asked for more speed than the slowest of many guesses has
        delay = min(max(round(bank[at + DELAY_S] / DELAY_STEP_S), 0), DELAYS - 1)
        if bank[at + AGAINST + delay * RATES + guess_of(told_share)] <= REFUTED:
            return told_share
    return 2.0 ** bank[at + LOG_RATE]


@kernel
def known_delay(bank: FloatArray, at: int, told_s: float) -> float:
    """Return the delay to count on, s; the told one where nothing refutes it."""
    return told_s if bank[at + TOLD_AGAINST] <= REFUTED else bank[at + DELAY_S]


@kernel
def look_at(
    bank: FloatArray,
    command: float,
    feedback: float,
    rate: float,
    travel: float,
    told_share: float,
    told_delay_s: float,
    dt_s: float,
) -> None:
    """Take in one command and its feedback as ``look`` does; the bank stands by itself."""
    look(bank, 0, command, feedback, rate, travel, told_share, told_delay_s, dt_s)


def warm_up() -> None:
    """Compile every kernel of this module with the argument types of real use."""
    bank = np.zeros(BANK_SIZE)
    look_at(bank, 0.0, 0.0, 1.0, 1.0, 1.0, 0.0, 0.1)
    known_rate(bank, 0, 1.0)
    known_delay(bank, 0, 0.0)
