"""The recordings that come with the source, and the simulators that made some of them."""
