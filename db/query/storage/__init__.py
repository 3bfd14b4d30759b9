"""How large stored data is, which of it may go, and where it went."""
