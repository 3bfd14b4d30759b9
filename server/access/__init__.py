"""Who may come in: people, roles, sessions, tokens, and requests that act once.

Publishes nothing.
"""
