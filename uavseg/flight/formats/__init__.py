"""Formats of mission files: each has a writer, a reader, and a list of what it cannot hold."""
