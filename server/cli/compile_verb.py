"""``grace compile``: machine code for the numeric kernels, made ahead of time."""

from argparse import ArgumentParser, Namespace
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

from autonomy import warm_up

_PROCESSES = 2


def add_arguments(parser: ArgumentParser) -> None:
    """Declare the options of the verb."""
    parser.add_argument(
        "--flight",
        action="store_true",
        help="only what simulated robots need at once; the station compiles the rest as it runs",
    )


def run(arguments: Namespace) -> int:
    """Compile what is not compiled yet; a second run looks at the sources alone."""
    if warm_up.is_complete(flight_only=arguments.flight):
        return 0
    digest = warm_up.source_digest()
    steps = warm_up.FLIGHT if arguments.flight else warm_up.STEPS
    with (
        Progress(
            TextColumn("Compiling the numeric kernels"),
            BarColumn(),
            MofNCompleteColumn(),
            TextColumn("{task.description}"),
            console=Console(stderr=True),
        ) as progress,
        ProcessPoolExecutor(_PROCESSES, mp_context=get_context("spawn")) as pool,
    ):
        task = progress.add_task("", total=len(steps))
        compiling = {pool.submit(warm_up.compile_step, step): step for step in steps}
        for ended in as_completed(compiling):
            ended.result()
            progress.update(task, advance=1, description=compiling[ended])
    warm_up.note_complete(digest, flight_only=arguments.flight)
    return 0
