"""The version of the package: one place for the code and for the build."""

__version__ = "1.0.0"
