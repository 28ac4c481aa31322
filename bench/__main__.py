"""`make bench`: everything that is claimed, measured in one run."""

from bench import memory, paper, queries, speed
from pipeline.console import out

for title, part in (
    ("The paper's rows", paper),
    ("Speed", speed),
    ("Memory", memory),
    ("Queries", queries),
):
    out.rule(title)
    part.main()
