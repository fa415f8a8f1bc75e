"""Run one command and write its time, memory and end: ``launch.py report.json limit memory command …``.

A process of its own, and a small one: a child starts with the peak memory of the process that made it.
"""

import json
import os
import resource
import signal
import sys
import time


def main() -> None:
    """Run the command given on the command line."""
    report, limit, memory, command = sys.argv[1], float(sys.argv[2]), float(sys.argv[3]), sys.argv[4:]
    resource.setrlimit(resource.RLIMIT_DATA, (int(memory), int(memory)))
    start = time.perf_counter()
    child = os.posix_spawnp(command[0], command, os.environ, setpgroup=0)
    late = []

    def stop(*_: object) -> None:
        late.append(True)
        os.killpg(child, signal.SIGKILL)  # what it started, too

    for number in (signal.SIGALRM, signal.SIGINT, signal.SIGTERM):
        signal.signal(number, stop)
    signal.setitimer(signal.ITIMER_REAL, limit)
    _, status, usage = os.wait4(child, 0)
    seconds = time.perf_counter() - start
    signal.setitimer(signal.ITIMER_REAL, 0)
    found = {
        "seconds": seconds,
        "peak": usage.ru_maxrss * 1024,
        "status": os.waitstatus_to_exitcode(status),
        "late": bool(late),
    }
    with open(report, "w") as file:
        json.dump(found, file)


if __name__ == "__main__":
    main()
