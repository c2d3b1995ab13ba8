"""What GDAL has for a thread and for the process while vectors are read and written: messages, options."""

import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager

_thread = threading.local()


@contextmanager
def gdal_options(options: Mapping[str, str]) -> Iterator[None]:
    """Options of GDAL, whose messages are warnings of Python, whatever the thread.

    The options belong to the process: only one thread at a time may be in such a context.

    pyogrio handles messages of the thread in which it was first imported. In all others GDAL prints them on
    stderr, and a geometry that it could not read is lost without a warning.

    Parameters
    ----------
    options : mapping of str
        They have their old values afterwards.
    """
    import pyogrio

    if not hasattr(_thread, "handles_messages"):
        from pyogrio._err import _register_error_handler  # as pyogrio does when it is imported

        _register_error_handler()
        _thread.handles_messages = True
    before = {option: pyogrio.get_gdal_config_option(option) for option in options}
    pyogrio.set_gdal_config_options(dict(options))
    try:
        yield
    finally:
        pyogrio.set_gdal_config_options(before)
