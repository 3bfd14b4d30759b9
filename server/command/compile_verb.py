"""``grace compile``: machine code for the numeric kernels, made ahead of time."""

from argparse import ArgumentParser, Namespace
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
        for name, done, _ in warm_up.compile_kernels():
            progress.update(task, completed=done, description=name)
    kept.parent.mkdir(exist_ok=True)
    kept.write_text(digest)
    return 0
