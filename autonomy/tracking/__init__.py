"""Following a target of which only the distance is measured (thesis chapter 4, Appendix C)."""
