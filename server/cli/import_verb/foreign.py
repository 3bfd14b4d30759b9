"""``grace import`` with a mapping: recordings of any maker, into a folder or a station."""

import json
import shutil
import tempfile
import time
from argparse import Namespace
from collections.abc import Generator
from collections.abc import Mapping as AnyMapping
from contextlib import ExitStack, contextmanager
from datetime import datetime
from pathlib import Path
from typing import Any

import httpx
from pydantic import ValidationError

from autonomy.channel import ChannelCatalogue
from db.fault import StoreError
from db.store import Store
from server.base.channels import catalogue_in
from server.base.job import JobError
from server.cli.data import POLL_PERIOD_S, checked, clock_of, open_remote, open_store, settings_of
from server.cli.data_folder import DataFolderError, DataFolderTakenError, hold_data_folder
from server.cli.failure import CommandError
from server.recording import foreign, intake
from server.recording.card import CardOrder, CardRefusedError, keep_card
from server.recording.foreign_task import ReadOrder, convert_upload, propose
from server.recording.map_fit import run as fit_maps
from server.recording_file.card import Card
from server.recording_file.conversion import Converted
from server.recording_file.mapping import Mapping

_AS_PROPOSED = "-"


def run_foreign(arguments: Namespace) -> int:
    """Print a proposal, or import by a mapping; every fault is printed with its place.

    Raises:
        CommandError: If the files are refused.
    """
    try:
        work = _by_station if arguments.url else _by_folder
        work(arguments)
    except JobError as error:
        for fault in (error.result or {}).get("named_faults", []):
            print(f"{fault['place']}: {fault['reason']}")
        raise CommandError(str(error)) from error
    except OSError as error:
        raise CommandError(f"{error.filename or 'file'}: {error.strerror}") from error
    return 0


def _mapping(arguments: Namespace, proposal: AnyMapping[str, Any]) -> Mapping:
    told = arguments.mapping
    try:
        text = proposal["mapping"] if told == _AS_PROPOSED else json.loads(Path(told).read_text())
        return Mapping.model_validate(text)
    except (ValueError, ValidationError) as error:
        raise CommandError(f"--mapping: {error}", status=2) from error


@contextmanager
def _order(arguments: Namespace, channels: ChannelCatalogue) -> Generator[ReadOrder]:
    """Lay the files out as an upload's are."""
    with tempfile.TemporaryDirectory(prefix="grace-import-") as folder:
        for place, file in enumerate(arguments.files):
            shutil.copyfile(file, Path(folder) / str(place))
        names = tuple(file.name for file in arguments.files)
        yield ReadOrder(Path(folder), names, channels, {})


def _by_folder(arguments: Namespace) -> None:
    settings = settings_of(arguments)
    try:
        with ExitStack() as stack:
            stack.enter_context(hold_data_folder(settings.data_dir))
            store = stack.enter_context(open_store(settings, is_held=True))
            with store.read() as session:
                channels = catalogue_in(session)
            order = stack.enter_context(_order(arguments, channels))
            proposal = propose(order, _ignore, lambda: False)
            if "refused" in proposal:
                raise CommandError(proposal["refused"])
            if arguments.propose:
                _print_proposal(proposal)
                return
            order = foreign.with_mapping(order, _mapping(arguments, proposal))
            wanted = foreign.Confirmed(
                order,
                foreign.hashes(order),
                arguments.robot,
                arguments.policy,
                "",
                "",
                "command line",
                arguments.clock_offset,
            )
            clock = clock_of(settings)
            _keep(store, wanted, clock.now(), clock.speed)
    except DataFolderTakenError as error:
        raise CommandError(f"{error} Import through it: give --url and GRACE_TOKEN.") from error
    except StoreError as error:
        raise CommandError(str(error)) from error
    except DataFolderError as error:
        raise CommandError(str(error)) from error


def _keep(store: Store, wanted: foreign.Confirmed, at: datetime, speed: float) -> None:
    converted = convert_upload(wanted.order, _ignore, lambda: False)
    if isinstance(converted, Card):
        _keep_card(store, foreign.card_order(wanted, converted, at, speed))
        return
    if not isinstance(converted, Converted):
        raise CommandError(_words(converted))
    converted = foreign.dated(converted, wanted)
    foreign.refuse(converted, wanted.policy)
    kept = store.change(
        lambda session: foreign.keep_confirmed(session, wanted, converted, at=at)
    ).result()
    recording = foreign.recording_of(converted)
    with store.read() as session:
        problem = intake.fit_problem(session, wanted.robot, recording)
    outcomes = fit_maps(problem, _ignore, lambda: False)
    store.change(
        lambda session: intake.keep_maps(session, wanted.robot, kept.deployment.id, outcomes, at)
    ).result()
    _print_report(foreign.report_of(kept, converted, outcomes))


def _keep_card(store: Store, order: CardOrder) -> None:
    try:
        kept = store.change(lambda session: keep_card(session, order, lambda: None)).result()
    except CardRefusedError as error:
        raise JobError(str(error), foreign.refusal(error.faults)) from error
    _print_report(foreign.card_report(kept, order.card))


def _ignore(news: object) -> None:
    del news


def _words(refused: str | list[tuple[str, str]]) -> str:
    if isinstance(refused, str):
        return refused
    return "; ".join(f"{place}: {reason}" for place, reason in refused)


def _by_station(arguments: Namespace) -> None:
    with open_remote(arguments) as client, ExitStack() as stack:
        files = [
            ("files", (one.name, stack.enter_context(one.open("rb")))) for one in arguments.files
        ]
        begun = checked(client.post("/api/imports/uploads", files=files)).json()
        proposal = _result(client, begun["id"])
        if arguments.propose:
            _print_proposal(proposal)
            return
        body = {
            "robot": arguments.robot,
            "mapping": _mapping(arguments, proposal).model_dump(mode="json"),
            "policy": arguments.policy.value,
            "clock_offset_s": arguments.clock_offset,
        }
        job = checked(client.post(f"/api/imports/uploads/{begun['upload']}", json=body)).json()
        _print_report(_result(client, job["id"]))


def _result(client: httpx.Client, job_id: str) -> Any:  # noqa: ANN401 - the job's own result
    while True:
        job = checked(client.get(f"/api/jobs/{job_id}")).json()
        if job["state"] not in {"queued", "running"}:
            break
        time.sleep(POLL_PERIOD_S)
    if job["state"] != "done":
        raise JobError(job["message"], job["result"])
    return job["result"]


def _print_proposal(proposal: AnyMapping[str, Any]) -> None:
    print(json.dumps(proposal["mapping"], indent=2, ensure_ascii=False))


def _print_report(report: AnyMapping[str, Any]) -> None:
    for fault in report["named_faults"]:
        print(f"{fault['place']}: {fault['reason']}")
    for note in report["notes"]:
        print(note)
    deployment = report["deployment"] or "no deployment"
    print(
        f"{deployment} of {report['robot']}: {report['read']} rows read, "
        f"{report['new']} new, {report['duplicate']} duplicate, {report['differs']} different, "
        f"{report['faults']} faulty."
    )
