"""MCAP files: bytes to records and messages, with salvage of damaged files; and the writer."""
