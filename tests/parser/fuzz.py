"""Coverage-guided search for bytes that make a parser fail; needs the package ``atheris``.

``python -m tests.parser.fuzz PARSER FOLDER -max_total_time=120`` goes on from the messages in
FOLDER and keeps there what reached new code; a fault is written down and ends the search. The
smallest set that still reaches all of it lies in ``tests/data/corpus``.
"""

import contextlib
import importlib
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Protocol, cast


class _Atheris(Protocol):
    """What is used of the package, which few machines have."""

    def instrument_imports(self, include: list[str]) -> contextlib.AbstractContextManager[None]: ...

    def Setup(self, arguments: list[str], feed: Callable[[bytes], None]) -> None: ...  # noqa: N802

    def Fuzz(self) -> None: ...  # noqa: N802


atheris = cast("_Atheris", importlib.import_module("atheris"))

with atheris.instrument_imports(include=["robot_link"]):
    from tests.parser.catalogue import catalogue


def main() -> None:
    name, folder, *options = sys.argv[1:]
    [parser] = [one for one in catalogue() if one.name == name]
    seeds = Path(folder)
    seeds.mkdir(parents=True, exist_ok=True)
    for number, capture in enumerate(parser.captures):
        (seeds / f"capture-{number}").write_bytes(capture)

    def feed(data: bytes) -> None:
        with contextlib.suppress(*parser.refusals):
            parser.make()(data[: parser.longest])

    atheris.Setup([sys.argv[0], folder, *options], feed)
    atheris.Fuzz()


if __name__ == "__main__":
    main()
