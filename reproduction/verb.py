"""``grace reproduce``: a table or figure of the thesis, ours beside the printed numbers."""

import sys
from argparse import ArgumentParser, Namespace
from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn
from rich.table import Column, Table
from rich.text import Text

from reproduction.catalogue import REPRODUCTIONS, reproduce
from reproduction.result import Reproduction, Row
from reproduction.writer import write

DEFAULT_SEED = 1
CAMERAS = "-cameras"
"""Ends the names of reproductions with cameras in them."""


def add_arguments(parser: ArgumentParser) -> None:
    """Declare the options of the verb."""
    parser.add_argument("name", nargs="?", metavar="NAME", help="which; --list names them all")
    parser.add_argument(
        "--out",
        type=Path,
        metavar="DIR",
        help="write NAME.json, NAME.csv and NAME.png there as well",
    )
    parser.add_argument(
        "--seed",
        type=int,
        default=DEFAULT_SEED,
        metavar="N",
        help=f"of every random number (default: {DEFAULT_SEED})",
    )
    parser.add_argument(
        "--cameras",
        action="store_true",
        help="with poses by cameras over the tank beside those of the thesis: table-3.3 alone",
    )
    parser.add_argument("--list", action="store_true", help="name what can be reproduced")


def run(arguments: Namespace) -> int:
    """Work it out; progress goes to stderr, the table to stdout, files into the folder."""
    if arguments.list:
        for name, title in REPRODUCTIONS.items():
            print(f"{name:17} {title}")
        return 0
    mistake = _mistake(arguments)
    if mistake:
        return _refuse(mistake, 2)
    result = _work_out(_name(arguments), arguments.seed)
    _print(result)
    if arguments.out is None:
        return 0
    try:
        files = write(result, arguments.out)
    except OSError as error:
        return _refuse(f"{arguments.out}: {error.strerror}.", 1)
    for file in files:
        print(file)
    return 0


def _name(arguments: Namespace) -> str:
    return f"{arguments.name}{CAMERAS}" if arguments.cameras else arguments.name


def _mistake(arguments: Namespace) -> str:
    """Return what is wrong with the options, "" if nothing is."""
    names = ", ".join(REPRODUCTIONS)
    if arguments.name is None:
        return f"Say which to reproduce: {names}."
    if arguments.name not in REPRODUCTIONS:
        return f"There is no {arguments.name!r}. There are: {names}."
    if arguments.cameras and _name(arguments) not in REPRODUCTIONS:
        able = ", ".join(name for name in REPRODUCTIONS if f"{name}{CAMERAS}" in REPRODUCTIONS)
        return f"Cameras are only for {able}."
    if arguments.seed < 0:
        return "The seed must be 0 or greater."
    if arguments.out is not None and arguments.out.exists() and not arguments.out.is_dir():
        return f"{arguments.out} is a file; name a folder."
    if arguments.out is not None and find_spec("matplotlib") is None:
        return (
            "Figures need matplotlib: install the extra `reproduction`, as `make reproduce` does."
        )
    return ""


def _refuse(sentence: str, status: int) -> int:
    print(f"grace reproduce: {sentence}", file=sys.stderr)
    return status


def _work_out(name: str, seed: int) -> Reproduction:
    with Progress(
        TextColumn(name),
        BarColumn(),
        TaskProgressColumn(),
        TextColumn("{task.description}"),
        console=Console(stderr=True),
    ) as progress:
        task = progress.add_task("getting ready", total=1.0)
        return reproduce(
            name,
            seed,
            lambda done, doing: progress.update(task, completed=done, description=doing),
        )


def _print(result: Reproduction) -> None:
    """Print scenario, table and notes; a cell is ours, and in brackets the thesis's.

    What the scenario holds of nested settings is left to the JSON file.
    """
    console = Console(highlight=False)
    console.print(result.title, style="bold", markup=False)
    for key, value in result.scenario.items():
        if not isinstance(value, Mapping):
            console.print(f"  {key}: {value}", markup=False)
    columns = tuple(dict.fromkeys(row.column for row in result.rows))
    table = Table(Column(""), *(Column(name, justify="right") for name in columns), "unit")
    table.box = SIMPLE_HEAD
    lines: dict[tuple[str, str], dict[str, Row]] = {}
    for row in result.rows:
        group, _, label = row.row.rpartition(": ")
        lines.setdefault((group, label), {})[row.column] = row
    shown = ""
    for (group, label), cells in lines.items():
        if group != shown:
            table.add_row(Text(group, style="bold"))
            shown = group
        unit = next(iter(cells.values())).unit
        table.add_row(label, *(_cell(cells.get(name)) for name in columns), unit)
    console.print(table)
    if any(row.thesis is not None for row in result.rows):
        console.print("In brackets: the thesis.")
    for note in result.notes:
        console.print(f"- {note}", markup=False)


def _cell(row: Row | None) -> str:
    if row is None:
        return ""
    thesis = "" if row.thesis is None else f" ({row.thesis:.3g})"
    return f"{row.ours:.3g}{thesis}"
