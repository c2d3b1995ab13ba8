"""Band arithmetic agrees with Python's own evaluation, in any chunks, and all else is refused."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from uavseg.errors import BandError, ExpressionError
from uavseg.raster.spectral import formula
from uavseg.raster.spectral.formula import MAX_CHARACTERS, MAX_DEPTH, parse_expression

BANDS = {"red": 1, "nir": 4}
DICE = np.random.default_rng(3)


def find(name: str) -> int:
    if name.lower() not in BANDS:
        raise BandError(f"no band is named {name!r}")
    return BANDS[name.lower()]


@st.composite
def expressions(draw: st.DrawFn, depth: int = 4) -> str:
    kind = draw(st.sampled_from(["name", "number", "sum", "sign", "call"])) if depth else "name"
    if kind == "name":
        return draw(st.sampled_from(["red", "nir"]))
    if kind == "number":
        return draw(st.sampled_from(["number(0)", "number(1)", "number(2.5)", "number(1e-3)"]))
    inner = expressions(depth=depth - 1)
    if kind == "sum":
        return f"({draw(inner)} {draw(st.sampled_from(['+', '-', '*', '/']))} {draw(inner)})"
    if kind == "sign":
        return f"-{draw(inner)}"
    name = draw(st.sampled_from(["abs", "min", "max"]))
    return f"{name}({draw(inner)})" if name == "abs" else f"{name}({draw(inner)}, {draw(inner)})"


def by_python(text: str, red: int, nir: int) -> float:
    """The value by Python itself, pixel by pixel: slow and plain."""
    scope = {"red": np.float64(red), "nir": np.float64(nir), "number": np.float64}
    with np.errstate(all="ignore"):
        return float(eval(text, scope | {"abs": np.abs, "min": np.minimum, "max": np.maximum}))


@pytest.mark.slow
@settings(max_examples=150)
@given(expressions(), st.lists(st.tuples(st.integers(0, 255), st.integers(0, 255)), min_size=1, max_size=6))
def test_values_are_those_of_python(text: str, pixels: list[tuple[int, int]]) -> None:
    text = f"(red + {text})"
    found = parse_expression(text.replace("number", ""), find)
    order = [{1: 0, 4: 1}[band] for band in found.bands]
    planes = np.array(pixels, np.uint8).T[order][:, None]
    expected = np.array([by_python(text, *pixel) for pixel in pixels])
    with np.errstate(over="ignore"):
        expected = expected.astype(np.float32)
    np.testing.assert_array_equal(found.compute(planes)[0], expected)


EVERY = "sqrt(abs(nir - red)) + exp(red / 255) * log(nir + 1) - log10(red + 2) ** 1.7 + max(nir, red) ** 2"


@settings(max_examples=40)
@given(
    st.integers(0, 39),
    st.integers(0, 49),
    st.integers(1, 40),
    st.integers(1, 50),
    st.sampled_from([7, 64, 1000]),
)
def test_a_part_has_the_bytes_of_the_whole_in_chunks_of_any_size(
    row: int, col: int, rows: int, cols: int, chunk: int
) -> None:
    planes = np.random.default_rng(5).integers(0, 60_000, (2, 40, 50)).astype(np.uint16)
    found, part = parse_expression(EVERY, find), np.s_[row : row + rows, col : col + cols]
    whole = found.compute(planes)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(formula, "CHUNK", chunk)
        assert found.compute(planes[:, *part]).tobytes() == whole[part].tobytes()


@pytest.mark.parametrize(
    "dtype", ["uint8", "int8", "uint16", "int16", "uint32", "int32", "float32", "float64"]
)
def test_small_integers_do_not_overflow(dtype: str) -> None:
    limits = np.iinfo(dtype) if np.dtype(dtype).kind in "iu" else np.finfo("float32")
    top = float(np.float32(limits.max))
    planes = np.full((2, 1, 1), limits.max, dtype)
    assert parse_expression("(nir + red) / 2", find).compute(planes)[0, 0] == np.float32(top)
    assert parse_expression("0 - nir", find).compute(planes)[0, 0] == np.float32(-top)


def test_squares_are_exact_and_roots_correctly_rounded() -> None:
    values = DICE.random((1, 1, 1000))
    assert np.array_equal(parse_expression("red ** 2", find)._run(values[:, 0]), values[0, 0] * values[0, 0])
    assert np.array_equal(parse_expression("red ** 0.5", find)._run(values[:, 0]), np.sqrt(values[0, 0]))


def test_scales_come_before_all_else() -> None:
    planes = np.array([[[200]], [[100]]], np.uint8)
    found = parse_expression("nir / red", find).compute(planes, [(0.5, -20.0), (0.1, 0.0)])
    assert found[0, 0] == np.float32((200 * 0.5 - 20) / (100 * 0.1))


@pytest.mark.parametrize(
    ("text", "column", "words"),
    [
        ("(ner - red) / (nir + red)", 2, "no band is named 'ner'"),
        ("nir / (red + blau)", 14, "no band is named 'blau'"),
        ("  nir + blau", 7, "blau"),  # spaces around do not count
        ("nir +", 6, "expected|too early"),
        ("", 1, "empty"),
        ("(nir", 1, "parenthes"),
        ("nir)", 4, "parenthes"),
        ("nir red", 5, "expected"),
        ("nir ^ 2", 7, r"\*\*"),
        ("median(nir)", 1, "functions are abs"),
        ("min(nir)", 1, "two values"),
        ("sqrt(nir, red)", 1, "one value"),
        ("nir + 1e999", 7, "too large"),
        ("nir + 'a'", 7, "expected"),
        ("nir * 2j", 7, "expected"),
        ("nir * True", 7, "expected"),
        ("nir if red else 1", 1, "expected"),
        ("nir < red", 1, "expected"),
        ("nir[0]", 1, "expected"),
        ("nir.dtype", 1, "expected"),
        ("(lambda: nir)()", 1, "functions"),
        ("__import__('os').system('true')", 1, "functions|expected"),
        ("nir.__class__()", 1, "functions"),
        ("[nir for nir in red]", 1, "expected"),
        ("nir := red", 5, "expected"),
        ("ä + nir", 1, "ä"),
        ("nir + ä + blau", 7, "ä"),
        ("-" * (MAX_DEPTH + 1) + "nir", MAX_DEPTH + 1, "deep"),
    ],
)
def test_what_is_wrong_is_pointed_at(text: str, column: int, words: str) -> None:
    with pytest.raises(ExpressionError, match=words) as caught:
        parse_expression(text, find)
    message, stripped = str(caught.value), text.strip()
    assert f"column {column} " in message
    assert f"{stripped[: column - 1][-60:]}^{stripped[column - 1 :]}:" in message


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("1 + 1", "no band"),
        ("nir +" * (MAX_CHARACTERS // 5) + " nir", "at most"),
        ("(" * 400 + "nir" + ")" * 400, "expected|nested"),
        ("nir\0", r"column 4 \(\^\), nir\^.x00"),
        ("nir\x1b[31m", "column 4"),
        ("nir # red", None),
    ],
)
def test_odd_texts_are_refused_in_one_line(text: str, words: str | None) -> None:
    if words is None:  # a comment changes nothing
        assert parse_expression(text, find).bands == (4,)
        return
    with pytest.raises(ExpressionError, match=words) as caught:
        parse_expression(text, find)
    assert str(caught.value).isprintable()


@settings(max_examples=300)
@given(st.text(alphabet="nired0123456789+-*/^()., _\"'\n\té[]{}:=<>@&|~%!", max_size=40))
def test_any_text_is_computed_or_refused(text: str) -> None:
    try:
        found = parse_expression(text, find)
    except ExpressionError as error:
        assert str(error).isprintable()
    else:
        assert found.compute(np.ones((len(found.bands), 2, 3), np.uint8)).shape == (2, 3)


def test_each_band_is_read_once() -> None:
    assert parse_expression("(nir - red) / (NIR + Red)", find).bands == (4, 1)
