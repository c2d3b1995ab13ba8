"""Names of outputs from names of inputs."""

from pathlib import Path

import pytest
from hypothesis import given, strategies as st

from uavseg.errors import OutputError
from uavseg.output.targets import check_distinct_outputs, fill_template, outputs_of

stems = st.text(st.characters(exclude_characters="\0/.", codec="utf-8"), min_size=1)


@given(stem=stems, folder=stems)
def test_the_words_of_a_path(stem: str, folder: str) -> None:
    source = f"{folder}/{stem}.tif"
    assert fill_template("{stem}|{name}|{suffix}|{parent}|{number}", source, 7) == (
        f"{stem}|{stem}.tif|tif|{folder}|0007"
    )


@given(text=st.text())
def test_braces_are_doubled_and_all_else_stays(text: str) -> None:
    assert fill_template(text.replace("{", "{{").replace("}", "}}"), "a.tif") == text


@pytest.mark.parametrize(
    "template", ["{steam}.gpkg", "{}.gpkg", "{stem.gpkg", "stem}.gpkg", "{ stem }", "{stem!r}"]
)
def test_other_words_are_refused(template: str) -> None:
    with pytest.raises(OutputError, match=r"is unknown; write \{stem\}, \{name\}"):
        fill_template(template, "a.tif")


def test_the_parent_of_a_bare_name_is_the_working_directory(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert fill_template("{parent}", "a.tif") == tmp_path.name


def test_two_sources_have_two_outputs() -> None:
    sources = ["west/a.tif", "east/a.tif"]
    check_distinct_outputs(sources, [[name] for name in outputs_of("{parent}-{stem}.gpkg", sources)])
    with pytest.raises(OutputError, match=r"west/a.tif and east/a.tif would both be written to \./a.gpkg"):
        check_distinct_outputs(sources, [["a.gpkg"], ["./a.gpkg"]])
    with pytest.raises(OutputError, match=r"west/a.tif and west/a.tif would both"):
        check_distinct_outputs(sources, [["a.tif", "a.tif"], ["b.tif"]])
