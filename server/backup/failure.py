"""What can go wrong with a backup."""


class BackupError(Exception):
    """A backup cannot be made or unpacked; the sentence says why and what to do."""
