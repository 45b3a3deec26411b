"""`python -m rendergraph`."""

import sys

from rendergraph.cli import main

if __name__ == "__main__":
    sys.exit(main())
