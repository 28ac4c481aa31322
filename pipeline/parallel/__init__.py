"""Work side by side: threads that make items ahead, processes that run tasks."""
