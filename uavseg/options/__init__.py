"""Options of the jobs, each described once; the faces are built from these descriptions."""
