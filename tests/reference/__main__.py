"""Compare N random problems: ``python -m tests.reference N [first seed]``; ends with 1 if any differs."""

import sys

from tests.reference.compare import LIMIT, compare


def main(count, first=0):
    """Print what differs, and the largest difference of each quantity; return how many problems differ."""
    largest, differing = {}, 0
    for seed in range(first, first + count):
        found = compare(seed)
        wrong = {name: value for name, value in found.items() if not value <= LIMIT}
        if wrong:
            differing += 1
            print(f"seed {seed}: {wrong}", flush=True)
        for name, value in found.items():
            largest[name] = max(largest.get(name, 0.0), value)
    shown = ", ".join(f"{name} {value:.1e}" for name, value in sorted(largest.items()))
    print(f"{count} problems, {differing} differ by more than {LIMIT:g}; largest differences: {shown}")
    return differing


if __name__ == "__main__":
    sys.exit(bool(main(*map(int, sys.argv[1:] or ["100"]))))
