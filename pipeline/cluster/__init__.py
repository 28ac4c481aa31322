"""Many recordings on many machines: every recording becomes Parquet files on shared storage.

engine:   where tasks run: processes of this machine, or Ray
split:    a window of a long recording, read alone
stitch:   windows of one recording put together again
tasks:    what one task does
run:      what there is to do, and what is done already

Nothing here talks to another task: they meet in a folder that all machines see (`cluster.manifest`).
"""
