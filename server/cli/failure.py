"""How a verb fails on purpose."""


class CommandError(Exception):
    """The command cannot do what was asked; the sentence says why and what to do."""

    def __init__(self, sentence: str, status: int = 1) -> None:
        super().__init__(sentence)
        self.status = status
