"""One function per job, called by the Python functions and by the commands."""
