"""`python -m rendergraph`."""

import sys

from rendergraph.cli.app import main

if __name__ == "__main__":
    sys.exit(main())
