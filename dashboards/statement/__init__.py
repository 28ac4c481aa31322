"""The statement on one person or pair: a page that is handed in."""
