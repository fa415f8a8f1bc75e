"""Verification: problems with a known answer, and the table of how well each element finds it."""
