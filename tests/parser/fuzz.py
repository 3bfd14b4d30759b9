"""Coverage-guided search for bytes that make a parser fail; needs the package ``atheris``.

``python -m tests.parser.fuzz PARSER FOLDER -max_total_time=120`` goes on from the messages in
FOLDER and keeps there what reached new code; a fault is written down and ends the search. The
smallest set that still reaches all of it lies in ``tests/data/corpus``.
"""

import contextlib
import sys
from pathlib import Path

import atheris

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
