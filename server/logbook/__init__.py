"""The log book: what people write and what happened, shifts, signed pages, and reports."""
