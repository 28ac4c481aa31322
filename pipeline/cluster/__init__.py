"""Many recordings on many machines: every recording becomes Parquet files on shared storage.

shared_run:      the recordings that are missing, handed out as tasks
engine:          Ray, as an engine that runs tasks
tasks:           a recording, a window of one, or the joining of windows, as one task each
manifest:        the files of a finished recording, described
results_folder:  finished recordings, asked with SQL or merged into a database

Nothing here talks to another task: they meet in a folder that all machines see (`cluster.manifest`).
"""
