"""Runners: how each analysis of a case is done, one file each."""
