"""Tells people who do not look at the page: by mail, ntfy, webhook and whatever apprise speaks."""
