"""Short texts of people, as others read them in a list or in the log."""

import unicodedata
from typing import Annotated, Final

from pydantic import AfterValidator, Field

NAME_LENGTH_MAX: Final = 100
TITLE_LENGTH_MAX: Final = 80
_UNSEEN: Final = frozenset({"Cc", "Cf", "Cs", "Co", "Cn", "Zl", "Zp"})
"""Categories of Unicode that a screen does not show, or by which it shows another order."""


def checked(text: str) -> str:
    """Return a short text.

    Raises:
        ValueError: If it holds what cannot be seen, such as a line break or a change of direction.
    """
    if any(unicodedata.category(letter) in _UNSEEN for letter in text):
        raise ValueError("must not hold characters that cannot be seen")
    return text


def shown(text: str, length_max: int = TITLE_LENGTH_MAX) -> str:
    """Return what can be seen of a text that nobody chose for others, such as a file's name."""
    return "".join(one for one in text if unicodedata.category(one) not in _UNSEEN)[:length_max]


Name = Annotated[
    str,
    Field(min_length=1, max_length=NAME_LENGTH_MAX, pattern=r"\S"),
    AfterValidator(checked),
]
"""Of a person or a token."""
Title = Annotated[
    str,
    Field(min_length=1, max_length=TITLE_LENGTH_MAX, pattern=r"\S"),
    AfterValidator(checked),
]
"""Of anything else."""
