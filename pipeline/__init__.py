"""stadimeter's pipeline: from a recording's bytes to distances and heights with intervals.

The way of the data, each stage knowing nothing of the next:

    ingest -> detect -> track -> measure  |  calibrate -> estimate  ->  store

`optics`, `records`, `errors` and `config` lie below the stages; `run` and `cli` above them.
"""

from importlib.metadata import PackageNotFoundError, version

try:
    __version__ = version("stadimeter")
except PackageNotFoundError:  # a checkout that was never installed
    __version__ = "0+unknown"
