"""`make bench`: every claim, measured in one run."""

from bench import (
    boxes,
    cluster,
    day,
    defocus,
    memory,
    paper,
    queries,
    scenes,
    size_prior,
    speed,
    street,
    timeline,
    tracking,
    walkers,
)
from pipeline.cli.console import out

for title, part in (
    ("The paper's rows", paper),
    ("The pose from walkers", walkers),
    ("Beside the plain size prior", size_prior),
    ("The street's survey", street),
    ("Tracks on the street", tracking),
    ("Boxes of the motion detector", boxes),
    ("Pictures of many cameras", scenes),
    ("Depth from defocus", defocus),
    ("Speed", speed),
    ("Timelines", timeline),
    ("Memory", memory),
    ("Queries", queries),
    ("A day", day),
    ("Many machines", cluster),
):
    out.rule(title)
    part.main()
