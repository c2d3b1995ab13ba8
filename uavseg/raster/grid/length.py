"""Lengths in metres or in pixels."""

from dataclasses import dataclass

from uavseg.errors import ParameterError


@dataclass(frozen=True, slots=True)
class Length:
    """A length in metres, or in pixels.

    Raises
    ------
    ParameterError
        If it is not finite and above 0.

    Examples
    --------
    >>> parse_length("8px")
    Length(value=8.0, in_pixels=True)
    """

    value: float
    in_pixels: bool = False

    def __post_init__(self) -> None:
        if not 0 < self.value < float("inf"):
            raise ParameterError(f"a detail or a width is a finite length above 0, not {self.value:g}")

    def __str__(self) -> str:
        return f"{self.value:.12g} {'pixels' if self.in_pixels else 'm'}"

    @property
    def word(self) -> str:
        """As options of the command line take it."""
        return f"{self.value!r}".removesuffix(".0") + ("px" if self.in_pixels else "")


def parse_length(text: str) -> Length:
    """Parse a length: metres, or pixels with the suffix px.

    Raises
    ------
    ParameterError
        If the text is not a finite number above 0, with or without px.
    """
    number = text.strip().lower()
    in_pixels = number.endswith("px")
    try:
        value = float(number.removesuffix("px"))
    except ValueError as error:
        raise ParameterError(
            f"a detail or a width is metres such as 2.5, or pixels such as 8px, not {text!r}"
        ) from error
    return Length(value, in_pixels)


def as_length(given: float | str | None) -> Length | None:
    """Metres, or a length as text such as "8px"; None is no length.

    Raises
    ------
    ParameterError
        If it is not a finite number above 0, with or without px.
    """
    if given is None:
        return None
    return parse_length(given) if isinstance(given, str) else Length(float(given))
