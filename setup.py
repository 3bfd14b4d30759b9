"""Holds a wheel to what it promises: the operator app with its manual and the MAVLink dialect.

All are made, not written (``make wheel`` makes them first), and setuptools would leave out what
is not there without a word.
"""

import shutil
from pathlib import Path

from setuptools import setup
from setuptools.command.build_py import build_py
from setuptools.errors import SetupError

MADE = (
    "webui/dist/index.html",
    "webui/dist/help/index.html",
    "robot_link/mavlink/dialect/grace.py",
)


class CompleteBuild(build_py):
    """Refuses to copy a tree that lacks a made part, and leaves nothing of an earlier build."""

    def run(self) -> None:
        """Copy the packages; an editable installation may be made complete later."""
        if not self.editable_mode:
            missing = [made for made in MADE if not Path(made).is_file()]
            if missing:
                raise SetupError(
                    f"the wheel would lack {' and '.join(missing)}; run `make wheel`, which "
                    "builds them first"
                )
            shutil.rmtree(self.build_lib, ignore_errors=True)
        super().run()


setup(cmdclass={"build_py": CompleteBuild})
