"""The command ``grace``: one verb, one module."""

import gc
import importlib
import os
import sys
from argparse import ArgumentParser
from collections.abc import Generator, Mapping, Sequence
from contextlib import contextmanager
from getpass import getuser
from importlib.metadata import version
from importlib.util import find_spec
from types import MappingProxyType

from db.actor import Actor, acting
from server.cli.failure import CommandError

VERBS: Mapping[str, str] = MappingProxyType(
    {
        "demo": "start the station with two simulated robots and print its address",
        "serve": "start the station alone",
        "upgrade": "take over from the station that runs, without losing what robots say",
        "simulate": "start the simulated robots alone",
        "robot": "add, list, retire robots; run one's onboard program alone, against its nodes",
        "link": "listen to a link and say what to try, or list the links of the robots",
        "camera": "look through a camera and say what it sees, or print tags and the board",
        "import": "take in a recorded deployment from CSV",
        "water": "make a water of files, or list the waters",
        "deployment": "list deployments, begin and end them, review and deliver their data",
        "export": "write a deployment as CSV, GeoJSON or KML",
        "design": "make a design of a plan file of another program, or such a file of a design",
        "journal": "write the raw journal as .tlog, or hold what is stored against it",
        "base-map": "add, list and remove offline charts that lie under every map",
        "token": "create, list and revoke the tokens of scripts",
        "user": "add people, change their role or password, make a sign-in link",
        "audit": "say whether the event log was changed, or write it to a file",
        "db": "upgrade, check, back up, restore or shrink the database; read moved rows back",
        "coefficients": "coefficients of a vehicle from forces and moments of a tunnel or CFD",
        "openapi": "write the OpenAPI document of the station's REST interface",
        "compile": "compile the numeric kernels ahead of time",
    }
)
EXTRAS: Mapping[str, tuple[str, str]] = MappingProxyType(
    {
        "reproduce": (
            "reproduction.verb",
            "work out a table or figure of the thesis, ours beside the printed numbers",
        ),
    }
)
"""Verbs of packages that the station does without: module and help; known where they are."""


_PRIVATE_MASK = 0o077
"""Database, logs, copies and secrets are for the station's user alone."""
_WRITE_FOR_OTHERS = frozenset(
    {"export", "audit", "design", "journal", "openapi", "coefficients", "compile", "camera"}
    | {*EXTRAS}
)
_RUN_BY_THEMSELVES = frozenset({"demo", "serve", "simulate", "robot"})
"""What these change later is nobody's doing."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one verb and return the exit status.

    A verb's module is imported only when it is asked for: it has ``add_arguments(parser)`` and
    ``run(arguments) -> int``, and ``completed(words)`` where some of them may be left out.
    """
    _keep_algebra_on_one_core()
    words = list(sys.argv[1:] if arguments is None else arguments)
    parser = ArgumentParser(
        prog="grace",
        description="Ground station for gliding robotic fish and small underwater gliders.",
        epilog="grace VERB --help says more about one.",
    )
    parser.add_argument("--version", action="version", version=version("grace-ground-station"))
    verbs = parser.add_subparsers(dest="verb", metavar="VERB", required=True)
    asked = next((word for word in words if not word.startswith("-")), None)
    modules = {verb: f"{__package__}.{verb.replace('-', '_')}_verb" for verb in VERBS}
    helps = dict(VERBS)
    for verb, (module_name, help_text) in EXTRAS.items():
        if find_spec(module_name.partition(".")[0]) is not None:
            modules[verb], helps[verb] = module_name, help_text
    for verb, help_text in helps.items():
        verb_parser = verbs.add_parser(
            verb, help=help_text, description=f"{help_text[0].upper()}{help_text[1:]}."
        )
        if verb == asked:
            with _nothing_collected(for_good=verb in _RUN_BY_THEMSELVES):
                module = importlib.import_module(modules[verb])
            words = getattr(module, "completed", list)(words)
            module.add_arguments(verb_parser)
            verb_parser.set_defaults(run=module.run)
    parsed = parser.parse_args(words)
    mask = os.umask(_PRIVATE_MASK)
    if parsed.verb in _WRITE_FOR_OTHERS:
        os.umask(mask)
    is_deed = parsed.verb not in _RUN_BY_THEMSELVES
    before = acting.set(Actor(_user(), "command line") if is_deed else None)
    try:
        return parsed.run(parsed)
    except CommandError as error:
        print(f"grace {parsed.verb}: {error}", file=sys.stderr)
        return error.status
    except PermissionError as error:
        print(
            f"grace {parsed.verb}: {error.filename} cannot be used ({error.strerror}); give this "
            "user the right to, or choose another with --data.",
            file=sys.stderr,
        )
        return 1
    except KeyboardInterrupt:
        return 130
    finally:
        acting.reset(before)
        os.umask(mask)


def _user() -> str:
    """Return who runs the command, as the operating system knows them."""
    try:
        return getuser()
    except (KeyError, OSError):  # a user id without a name, as in a container
        return f"user {os.getuid()}"


@contextmanager
def _nothing_collected(*, for_good: bool) -> Generator[None]:
    """Load modules without looking for garbage in them, which would be a fifth of a start.

    Args:
        for_good: Nor look through them later, at each full collection of a process that stays.
    """
    gc.disable()
    try:
        yield
    finally:
        if for_good:
            gc.freeze()
        gc.enable()


def _keep_algebra_on_one_core() -> None:
    """Set what numpy reads when it is first imported, here and in every process started from here.

    Matrices of a few hundred rows gain nothing from threads, and threads that wait for a busy core
    stall a factorization for tenths of a second.
    """
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
