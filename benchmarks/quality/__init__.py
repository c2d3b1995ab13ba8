"""How well regions match what a person would draw: seeded scenes with truth, marks, methods.

``python -m benchmarks --quality`` measures; docs/quality.md keeps the tables and tells how to read them.
"""
