"""Run the command line with ``python -m kratos_lite``."""

import sys

from kratos_lite.cli import main

if __name__ == "__main__":
    sys.exit(main())
