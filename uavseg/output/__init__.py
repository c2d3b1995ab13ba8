"""Output files: which files a target has, and how the outputs of one command appear together."""
