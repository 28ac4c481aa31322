"""Pass 2: from stored measurements to depths and heights, by every method that applies."""
