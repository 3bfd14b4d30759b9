"""Kills at random moments: what was acknowledged is kept, and the station comes back.

A real demo in the middle of measuring and planning: station, simulator, a PostgreSQL server or a
SQLite file. The satellite gateway is part of the simulator's process and dies with it. One robot
dives and measures, one is planned for, one far away calls by satellite.

``python -m benchmarks.station.kills [kills] [seed] [sqlite]`` runs it alone.
"""

import os
import random
import signal
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Generator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from benchmarks.calibration import NotMeasuredError
from benchmarks.field.field import at_most
from benchmarks.station.kills_witness import Losses, Witness
from tests.e2e.demo import Demo, fly_dives
from tests.postgresql_server import PostgresqlServer, postgresql_server

AREA = "kills"
KILLS = 20
BACK_S = 10.0
"""On a quiet machine: from the start of the process until all answer and report again."""
REST_S = (0.0, 12.0)
"""Before each kill, s of the wall: drawn uniformly."""
DOWN_S = (0.5, 5.0)
"""How long a database server stays away."""
OPTIONS = ("--robots", "mini-1,mini-2,grace-1", "--far", "--speed", "5")
DIVER, PLANNED_FOR = "mini-1", "mini-2"
PLANNING_TIME_S = 8.0
DATABASE = "database"
PROCESSES = ("serve", "simulate")
ON_THE_WAY = ("draft", "sent", "on_board")
GIVEN_UP = "Its making was interrupted"
"""Begins the words of a plan that was interrupted more often than it is taken up again."""


@dataclass(frozen=True, slots=True)
class Kill:
    """One process that was killed, and how long after its new start all was as before, s."""

    victim: str
    back_s: float


@dataclass(frozen=True, slots=True)
class Report:
    """What became of a run."""

    kills: list[Kill]
    met: int
    """How many plans in the making were interrupted by the station's end."""
    unmade: list[str]
    """Why plans were not made, but for those that were interrupted once too often."""
    losses: Losses


def measure() -> list[dict[str, Any]]:
    """Kill twenty times on each engine there is, at moments that are drawn now."""
    seed = random.SystemRandom().randrange(2**32)
    rows = _rows(seed, on_postgresql=False)
    try:
        rows += _rows(seed, on_postgresql=True)
    except NotMeasuredError as error:
        row = at_most(AREA, "kills with PostgreSQL", 0.0, str(error), None)
        rows.append(row | {"value": None, "met": None})
    return rows


def drawn_victims(drawn: random.Random, kills: int, *, on_postgresql: bool) -> list[str]:
    """Draw what is killed; each kind of process at least once where the kills suffice."""
    kinds = [*PROCESSES, *([DATABASE] if on_postgresql else [])]
    victims = [*kinds, *drawn.choices(kinds, k=max(kills - len(kinds), 0))][:kills]
    drawn.shuffle(victims)
    return victims


def run(
    victims: Sequence[str],
    drawn: random.Random,
    *,
    on_postgresql: bool,
    rest_s: tuple[float, float] = REST_S,
) -> Report:
    """Kill one process after another, and judge what is left.

    Args:
        victims: What is killed.
        drawn: Draws when.
        on_postgresql: Rather than on a SQLite file.
        rest_s: Time between a robot that measures with a plan in the making, and the next kill.

    Raises:
        NotMeasuredError: If PostgreSQL is asked for on a machine without it.
    """
    with (
        _database(on_postgresql=on_postgresql) as (server, url),
        tempfile.TemporaryDirectory() as folder,
    ):
        data = Path(folder)
        environment = os.environ | ({"GRACE_DATABASE_URL": url} if url else {})
        kills: list[Kill] = []
        options = (*OPTIONS, "--seed", str(drawn.randrange(2**31)))
        with Demo(data, *options, environment=environment) as demo:
            demo.sign_in()
            with Witness(data, demo.client) as witness:
                for victim in victims:
                    _keep_measuring(demo, witness)
                    _keep_planning(demo)
                    time.sleep(drawn.uniform(*rest_s))
                    kills.append(Kill(victim, _kill(demo, server, victim, drawn)))
                    print(f"{kills[-1].victim}: back after {kills[-1].back_s:.1f} s", flush=True)
                met, unmade = _plans_at_the_end(demo)
            demo.wait("all rows in the database", lambda: _has_written(demo), 60.0)
            losses = witness.losses(url or f"sqlite:///{data}/station.sqlite3")
    return Report(kills, met, unmade, losses)


@contextmanager
def _database(*, on_postgresql: bool) -> Generator[tuple[PostgresqlServer | None, str | None]]:
    """Return a server and the URL of an empty database of it; neither for a SQLite file."""
    if not on_postgresql:
        yield None, None
        return
    with postgresql_server() as server:
        if server is None:
            raise NotMeasuredError("this machine has no PostgreSQL server")
        yield server, server.url(server.database())


def _kill(demo: Demo, server: PostgresqlServer | None, victim: str, drawn: random.Random) -> float:
    """Kill one process; return how long after its new start all was as before, s."""
    if victim == DATABASE:
        assert server is not None  # noqa: S101 - it is among the victims where there is one
        server.kill()
        time.sleep(drawn.uniform(*DOWN_S))
        server.start()
    else:
        old = demo.children()[victim]
        os.kill(old, signal.SIGKILL)
        demo.wait(f"a new {victim}", lambda: demo.children().get(victim, old) != old, 30.0)
    began_s = time.monotonic()
    before = demo.wait("an answer", lambda: _heard(demo), 60.0)
    demo.wait("rows kept and robots heard", lambda: _is_well(demo, before), 60.0)
    return time.monotonic() - began_s


def _heard(demo: Demo) -> dict[str, str]:
    """Return when the robots in reach of radio were heard last."""
    return {
        robot: demo.get(f"/api/robots/{robot}/state")["position"]["received_at"]
        for robot in (DIVER, PLANNED_FOR)
    }


def _is_well(demo: Demo, before: dict[str, str]) -> bool:
    """Tell whether the station works, keeps rows in its database, and hears robots anew."""
    health = demo.get("/api/health")
    is_kept = health["storage"]["ok"] and not health["storage"]["bridged_rows"]
    return (
        health["ready"]
        and is_kept
        and all(at > before[robot] for robot, at in _heard(demo).items())
    )


def _has_written(demo: Demo) -> bool:
    storage = demo.get("/api/health")["storage"]
    return storage["ok"] and not storage["bridged_rows"]


def _keep_measuring(demo: Demo, witness: Witness) -> None:
    """Have a robot that flies and measures, and is told that its samples are stored."""
    before = witness.acknowledged_samples

    def has_measured() -> bool:
        on_board = demo.get(f"/api/robots/{DIVER}/state")["plan"]
        if on_board is None or on_board["state"] != "running":
            plan = fly_dives(demo, 30, 0.6)
            demo.wait("a plan in flight", lambda: _state(demo, plan) not in ON_THE_WAY, 60.0)
        return witness.acknowledged_samples > before

    demo.wait("samples acknowledged", has_measured, 60.0)


def _state(demo: Demo, plan: str) -> str:
    return demo.get(f"/api/plans/{plan}")["state"]


def _keep_planning(demo: Demo) -> None:
    """Have a plan in the making, so that kills meet one."""
    if any(plan["state"] == "planning" for plan in _plans(demo)):
        return
    wanted = {"kind": "adaptive_survey", "config": {"planning_time_s": PLANNING_TIME_S}}
    demo.post(f"/api/robots/{PLANNED_FOR}/plans", wanted)


def _plans(demo: Demo) -> list[dict[str, Any]]:
    answer = demo.client.get(f"/api/robots/{PLANNED_FOR}/plans", params={"limit": 1000})
    return answer.raise_for_status().json()


def _plans_at_the_end(demo: Demo) -> tuple[int, list[str]]:
    """Return how many plans were taken up again, and why others were never made."""

    def ended() -> list[dict[str, Any]]:
        plans = _plans(demo)
        return [] if any(plan["state"] == "planning" for plan in plans) else plans

    plans = demo.wait("the end of planning", ended, 300.0)
    events = demo.get("/api/events", robot=PLANNED_FOR, kind="plan.planning", limit="1000")
    met = sum("Taken up again" in event["text"] for event in events["events"])
    failed = [plan["message"] for plan in plans if plan["state"] == "failed"]
    return met, [message for message in failed if GIVEN_UP not in message]


def _rows(seed: int, *, on_postgresql: bool) -> list[dict[str, Any]]:
    drawn = random.Random(seed)
    victims = drawn_victims(drawn, KILLS, on_postgresql=on_postgresql)
    found = run(victims, drawn, on_postgresql=on_postgresql)
    losses, engine = found.losses, "PostgreSQL" if on_postgresql else "SQLite"
    killed = ", ".join(f"{count} {name}" for name, count in sorted(Counter(victims).items()))
    what = f"{engine}, SIGKILL of {killed} (seed {seed})"
    names = f"{losses.samples} samples, {losses.entries} entries, {losses.messages} messages"
    back_s = sorted(kill.back_s for kill in found.kills)
    return [
        at_most(AREA, f"{what}: acknowledged and lost, of {names}", losses.lost, "", 0),
        at_most(AREA, f"{engine}: rows twice", losses.doubles, "", 0),
        at_most(AREA, f"{engine}: slowest return", back_s[-1], "s", BACK_S),
        at_most(AREA, f"{engine}: median return", back_s[len(back_s) // 2], "s", BACK_S),
        at_most(AREA, f"{engine}: plans not made, {found.met} taken up", len(found.unmade), "", 0),
    ]


if __name__ == "__main__":
    WORDS = dict(enumerate(sys.argv[1:]))
    DRAWN = random.Random(WORDS.get(1))
    ON_POSTGRESQL = WORDS.get(2) != "sqlite"
    VICTIMS = drawn_victims(DRAWN, int(WORDS.get(0, KILLS)), on_postgresql=ON_POSTGRESQL)
    print(run(VICTIMS, DRAWN, on_postgresql=ON_POSTGRESQL))
