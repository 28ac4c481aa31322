"""Review of recordings in a Rerun viewer on this machine."""
