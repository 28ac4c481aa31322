"""For_docs."""
