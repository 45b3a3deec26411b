"""`python -m rendergraph.cli`."""

import sys

from rendergraph.cli.app import main

sys.exit(main())
