"""Executors: serial, threads or a cluster; checkpoints of long runs."""
