"""What a check says of a file: passed, findings, or that it could not be checked."""

from dataclasses import dataclass
from typing import Literal

State = Literal["passed", "findings", "unchecked"]


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing that is wrong, and what to do about it."""

    check: str
    variable: str
    """Of the file, or a global attribute; empty where it is the file as a whole."""
    message: str
    fix: str


@dataclass(frozen=True, slots=True)
class CheckReport:
    """What one suite of checks found."""

    suite: str
    version: str
    """Of the checker; empty where it is not there."""
    state: State
    """``unchecked`` wherever the suite did not come to its end; that is never ``passed``."""
    findings: tuple[Finding, ...]
    message: str
    """Why it could not be checked; empty otherwise."""
    seconds: float
