"""``grace compile``: machine code for the numeric kernels, made ahead of time."""

from argparse import ArgumentParser, Namespace
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

_DIGEST_FILE = "compiled.digest"


def add_arguments(parser: ArgumentParser) -> None:
    """The verb has no options."""
    del parser


def run(arguments: Namespace) -> int:
    """Compile what is not compiled yet; a second run loads the cache and is quick."""
    del arguments
    # Importing the kernels loads the compiler, which no other verb needs.
    from autonomy import warm_up

    digest = warm_up.source_digest()
    kept = Path(warm_up.__file__).parent / "__pycache__" / _DIGEST_FILE
    if kept.exists() and kept.read_text() == digest:
        return 0
    warm_up.forget_compiled()
    with Progress(
        TextColumn("Compiling the numeric kernels"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.description}"),
        console=Console(stderr=True),
    ) as progress:
        task = progress.add_task("", total=len(warm_up.KERNEL_MODULES))
        for name in _compiled():
            progress.update(task, advance=1, description=name)
    kept.parent.mkdir(exist_ok=True)
    kept.write_text(digest)
    return 0


def _compiled() -> Iterator[str]:
    """Compile every module, the longest one beside the others, and name each when it is ready."""
    from autonomy import warm_up

    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as beside:
        longest = beside.submit(warm_up.compile_module, warm_up.LONGEST)
        for name in warm_up.KERNEL_MODULES:
            if name != warm_up.LONGEST:
                warm_up.compile_module(name)
                yield name
        longest.result()
        yield warm_up.LONGEST
