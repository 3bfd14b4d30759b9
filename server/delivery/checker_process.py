"""The closed child: runs one suite of the field's checkers over one file, answers as JSON.

Nothing else of the station is loaded here. Looking up an address raises, so no check can reach
the network, nor hang on one that swallows packets.
"""

import contextlib
import importlib
import io
import json
import socket
import sys
from typing import Any, NoReturn


def _refuse(*_: object, **__: object) -> NoReturn:
    raise OSError("the checkers have no network")


def main(path: str, suite: str, skipped: list[str]) -> int:
    """Print what the suite found; a status that is not 0 says that it did not come to its end."""
    socket.getaddrinfo = _refuse
    out = sys.stdout
    with contextlib.redirect_stdout(io.StringIO()):
        answer = _run(path, suite, skipped)
    json.dump(answer, out)
    return 0


def _run(path: str, suite: str, skipped: list[str]) -> dict[str, Any]:
    runner: Any = importlib.import_module("compliance_checker.runner")
    checks = runner.CheckSuite()
    checks.load_all_available_checkers()
    dataset = checks.load_dataset(path)
    found = checks.run_all(dataset, [suite], skip_checks=skipped)
    results, errors = found[suite]
    return {
        "results": [
            {"name": str(one.name), "got": got, "of": of, "messages": list(one.msgs or [])}
            for one in results
            for got, of in [_points(one.value)]
        ],
        "errors": [f"{name}: {error[0]}" for name, error in errors.items()],
    }


def _points(value: Any) -> tuple[float, float]:  # noqa: ANN401 - a pair, or whether it passed
    return (float(value[0]), float(value[1])) if isinstance(value, tuple) else (float(value), 1.0)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], sys.argv[2], sys.argv[3:]))
