"""What commands print in these tests does not depend on which kernels this machine has compiled before."""

import pytest

from uavseg._jit import messages


@pytest.fixture(autouse=True)
def compiled_silently(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(messages, "announce", lambda name: None)
