"""``grace journal``: the raw journal as a telemetry log, and what is stored held against it."""

import asyncio
import sys
import tempfile
from argparse import ArgumentParser, Namespace
from datetime import UTC, datetime
from pathlib import Path

from autonomy.chart import CHARTS
from db.fault import UnknownIdError
from db.query.mission.decisions import DecisionRange
from db.query.station.journal import JournalRange, iterate_frames
from db.query.storage.told import pruned_stretches
from db.store import Store
from server.base.decision.replay import DecisionReplay, Verdict, counted
from server.base.secret import SecretStore
from server.base.settings import Settings
from server.base.worker import WorkerPool
from server.cli.data import clock_of, open_store, settings_of
from server.cli.failure import CommandError
from server.cli.option import add_data_option
from server.recording.decision_kind import KINDS
from server.recording.replay import compare, replay_into
from server.recording.tlog import tlog_blocks
from server.water.waters import CHART_FOLDER

_REBUILT = "station.sqlite3"


def add_arguments(parser: ArgumentParser) -> None:
    """Declare the options of the verb."""
    actions = parser.add_subparsers(dest="action", required=True)
    tlog = actions.add_parser("tlog", help="write MAVLink packets as a .tlog file")
    tlog.add_argument("file", type=Path, help="where to; must not exist yet")
    tlog.add_argument("--robot", help="only packets of this robot")
    tlog.add_argument("--start", type=_moment, help="first moment, such as 2026-11-21T08:00Z")
    tlog.add_argument("--end", type=_moment, help="last moment")
    add_data_option(tlog)
    replay = actions.add_parser("replay", help="build all telemetry anew and compare it")
    what = replay.add_mutually_exclusive_group()
    what.add_argument("--into", type=Path, help="keep the rebuilt database in this new folder")
    what.add_argument(
        "--decisions",
        action="store_true",
        help="make what was planned, learned and suggested once more, and compare that instead",
    )
    replay.add_argument("--robot", help="only decisions of this robot")
    replay.add_argument("--start", type=_moment, help="first moment, such as 2026-11-21T08:00Z")
    replay.add_argument("--end", type=_moment, help="first moment that does not count any more")
    add_data_option(replay)


def run(arguments: Namespace) -> int:
    """Do one of the two; a running station is not disturbed."""
    settings = settings_of(arguments)
    with open_store(settings) as store:
        if arguments.action == "tlog":
            wanted = JournalRange(arguments.robot, arguments.start, arguments.end)
            return _write_tlog(store, wanted, arguments.file)
        if arguments.decisions:
            CHARTS.open(settings.data_dir / CHART_FOLDER)
            robots = None if arguments.robot is None else (arguments.robot,)
            chosen = DecisionRange(robots, arguments.start, arguments.end)
            return asyncio.run(_replay_decisions(store, chosen))
        if arguments.robot or arguments.start or arguments.end:
            raise CommandError("--robot, --start and --end go with --decisions.", status=2)
        if arguments.into is not None:
            if arguments.into.exists():
                raise CommandError(f"{arguments.into} exists; name a new folder.", status=2)
            arguments.into.mkdir(parents=True)
            return _replay(store, settings, arguments.into)
        with tempfile.TemporaryDirectory() as folder:
            return _replay(store, settings, Path(folder))


def _write_tlog(store: Store, wanted: JournalRange, file: Path) -> int:
    try:
        with store.read() as session, file.open("xb") as target:
            target.writelines(tlog_blocks(iterate_frames(session, wanted)))
    except FileExistsError as error:
        raise CommandError(f"{file} exists; nothing was written.") from error
    except OSError as error:
        file.unlink(missing_ok=True)
        raise CommandError(f"{file}: {error.strerror}; nothing was written.") from error
    except UnknownIdError as error:
        file.unlink()
        raise CommandError(f"There is no robot {wanted.robot}.") from error
    print(f"{file.stat().st_size} bytes are in {file}.")
    return 0


def _replay(store: Store, settings: Settings, folder: Path) -> int:
    keys = SecretStore(settings.secret_dir)
    # Never the station's own database, which the environment may name.
    rebuilt = Store.open(f"sqlite:///{(folder / _REBUILT).resolve()}")
    try:
        with store.read() as session:
            packets = replay_into(session, rebuilt, clock_of(settings).speed, keys.robot_key)
            found = compare(session, rebuilt)
            pruned = pruned_stretches(session)
    finally:
        rebuilt.close()
    print(f"{packets} packets of the journal were replayed.")
    print(*(f"{one.text}\n" for one in pruned), sep="", end="")
    for table in found:
        print(
            f"{table.table:14} {table.same} rows the same, {table.only_stored} only stored, "
            f"{table.only_replayed} only in the journal"
        )
    return 0 if all(not table.only_stored and not table.only_replayed for table in found) else 1


async def _replay_decisions(store: Store, wanted: DecisionRange) -> int:
    """Say of each decision whether it is made the same once more; 1 unless all are."""
    workers = WorkerPool()
    replay = DecisionReplay(store, workers, KINDS)
    try:
        verdicts = await replay.run(wanted, lambda _, text: print(text, file=sys.stderr))
    finally:
        workers.hurry()
        await workers.stop()
    for verdict in verdicts:
        print(_line(replay, verdict))
    print(f"{counted(verdicts)}.")
    return 0 if all(verdict.word == "same" for verdict in verdicts) else 1


def _line(replay: DecisionReplay, verdict: Verdict) -> str:
    decision = verdict.decision
    because = f", because {verdict.because}" if verdict.because else ""
    about = f" {decision.about}" if decision.about else ""
    return (
        f"{decision.id:14} {decision.at:%Y-%m-%d %H:%M:%S}Z {decision.robot:10} "
        f"{replay.title(decision)}{about} ({decision.state}): {verdict.word}{because}"
    )


def _moment(text: str) -> datetime:
    at = datetime.fromisoformat(text)
    return at if at.tzinfo is not None else at.replace(tzinfo=UTC)
