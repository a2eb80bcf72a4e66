"""The words of results: what a command prints and what a page says."""
