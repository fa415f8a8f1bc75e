"""Fuzzers: damaged and random inputs of every format, and what must hold for each of them."""
