"""The command line: ``kratos-lite solve | info | check | convert | verify | ccx | bench``."""

from __future__ import annotations

import atexit
import gc
import io
import os
import signal
import sys
from argparse import Namespace
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress

from kratos_lite.cli import commands
from kratos_lite.cli.parser import build_parser, with_values
from kratos_lite.cli.ranks import share
from kratos_lite.errors import KratosLiteError

EXIT_BAD_INPUT, EXIT_INTERNAL, EXIT_INTERRUPTED = 2, 1, 130


class Terminated(KeyboardInterrupt):
    """A signal asks the program to end; what Ctrl-C cleans up is cleaned up."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; return its exit code, one of `EXIT_CODES`."""
    atexit.register(gc.freeze)  # at its end Python would look through all objects for garbage, for 15 ms
    gc.set_threshold(100_000)  # and a hundred times while modules are loaded, for 5 ms
    _escape_unknown_characters()
    words = with_values(sys.argv[1:] if arguments is None else arguments)
    signals: list[KeyboardInterrupt] = []
    try:
        with _ended_by_signals(signals):
            return _run(words) if share(words) else 0
    except (Exception, KeyboardInterrupt) as error:
        # a module that a signal keeps from loading says something else
        code, text = _verdict(signals[0] if signals else error)
        if "--debug" in words and not isinstance(error, (KeyboardInterrupt, BrokenPipeError)):
            raise
        if text:
            print(text, file=sys.stderr, flush=True)
        return code


def _verdict(error: BaseException) -> tuple[int, str]:
    """Return the exit code of an error and what to say of it."""
    if isinstance(error, KeyboardInterrupt):
        ended = isinstance(error, Terminated)
        text = f"{'terminated' if ended else 'interrupted'}; nothing half-written is left"
        return 128 + error.args[0] if ended else EXIT_INTERRUPTED, text
    if isinstance(error, BrokenPipeError):
        _discard_output()
        return 0, ""
    if isinstance(error, KratosLiteError):
        # The texts are written for Python; here the same choice is an option.
        return EXIT_BAD_INPUT, f"error: {str(error).replace('strict=False', '--lenient')}"
    if isinstance(error, OSError):
        _discard_output()
        return EXIT_BAD_INPUT, f"error: {error.filename or 'the output'}: {error.strerror or error}"
    if isinstance(error, MemoryError):
        return EXIT_BAD_INPUT, "error: not enough memory; use a coarser mesh or --solver amg"
    return EXIT_INTERNAL, (
        f"internal error: {type(error).__name__}: {error}\n"
        "This is a defect of kratos-lite; please report it with the output of --debug."
    )


def _run(words: Sequence[str]) -> int:
    """Run one command; return its exit code."""
    parser = build_parser()
    parser.refuse_first(words)
    options, rest = parser.parse_known_args(words)
    options.rest = rest
    if rest and options.command not in ("bench", "ccx"):
        parser.refuse(options.command, rest)
    code = _run_each(options)
    if sys.stdout:
        sys.stdout.flush()  # a full disk shows here rather than after the end of the program
    return code


def _run_each(options: Namespace) -> int:
    """Run a command, on each of its files if it takes several; return the largest exit code."""
    command, inputs = getattr(commands, options.command), getattr(options, "input", None)
    if not isinstance(inputs, list):
        return int(command(options))
    code = 0
    for path in inputs:
        one = Namespace(**{**vars(options), "input": path})
        if len(inputs) == 1:
            return int(command(one))
        print(f"== {path}", flush=True)
        try:
            code = max(code, int(command(one)))
        except KratosLiteError as error:
            print(_verdict(error)[1], file=sys.stderr, flush=True)
            code = max(code, EXIT_BAD_INPUT)
    return code


@contextmanager
def _ended_by_signals(came: list[KeyboardInterrupt]) -> Iterator[None]:
    """Let SIGTERM and SIGHUP end the program as Ctrl-C does, unless they are ignored or used otherwise."""

    def end(number: int, _: object) -> None:
        came.append(KeyboardInterrupt() if number == signal.SIGINT else Terminated(number))
        raise came[-1]

    ours = {}
    for name in ("SIGINT", "SIGTERM", "SIGHUP"):
        number = getattr(signal, name, None)
        if number and signal.getsignal(number) in (signal.SIG_DFL, signal.default_int_handler):
            with suppress(ValueError):  # another thread than the main one
                ours[number] = signal.signal(number, end)
    try:
        yield
    finally:
        for number, handler in ours.items():
            signal.signal(number, handler)


def _escape_unknown_characters() -> None:
    """Let a terminal without ≤ and × show their codes instead of failing."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def _discard_output() -> None:
    """Send what is still to be printed nowhere, so that Python does not fail on it at its end."""
    with suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
