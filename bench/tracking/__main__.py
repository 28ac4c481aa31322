"""`python -m bench.tracking`."""

import sys

from bench.tracking import main

main(sys.argv[1:])
