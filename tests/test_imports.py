"""Which way imports point, and that starting up brings in nothing heavy."""

import ast
import json
import os
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

import uavseg

PACKAGE = Path(uavseg.__file__).resolve().parent
HEAVY = {
    *("numpy", "rasterio", "numba", "llvmlite", "geopandas", "pandas", "shapely", "pyproj", "pyogrio"),
    *(
        "pyarrow",
        "matplotlib",
        "pymavlink",
        "scipy",
        "dask",
        "distributed",
        "affine",
        "antimeridian",
        "rosbags",
        "skimage",
    ),
}


@dataclass(frozen=True)
class Import:
    """One module imports another; `now` where it does so as soon as it is itself imported."""

    importer: str
    imported: str
    now: bool
    for_types: bool


def name_of(path: Path) -> str:
    parts = [PACKAGE.name, *path.relative_to(PACKAGE).with_suffix("").parts]
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


@cache
def modules() -> dict[str, Path]:
    return {name_of(path): path for path in sorted(PACKAGE.rglob("*.py"))}


def imports_in(node: ast.AST, importer: str, now: bool = True, for_types: bool = False) -> Iterator[Import]:
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.Import):
            yield from (Import(importer, alias.name, now, for_types) for alias in child.names)
        elif isinstance(child, ast.ImportFrom):
            assert child.level == 0, f"{importer} imports by dots; name modules in full"
            for alias in child.names:
                whole = f"{child.module}.{alias.name}"
                yield Import(importer, whole if whole in modules() else str(child.module), now, for_types)
        elif isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda):
            yield from imports_in(child, importer, False, for_types)
        elif isinstance(child, ast.If) and ast.unparse(child.test).endswith("TYPE_CHECKING"):
            yield from imports_in(child, importer, False, True)
        else:
            yield from imports_in(child, importer, now, for_types)


@cache
def imports() -> tuple[Import, ...]:
    return tuple(
        found
        for name, path in modules().items()
        for found in imports_in(ast.parse(path.read_text(encoding="utf-8")), name)
    )


def folder_of(module: str) -> str:
    """Folder of a module, such as "raster.geodesy"; the name itself for a file beside the folders."""
    path = modules()[module]
    parts = module.split(".")[1:]
    return ".".join(parts if path.name == "__init__.py" else parts[:-1] or parts) or "uavseg"


def package_of(module: str) -> str:
    """Top-level folder of a module, or the module itself where it lies beside the folders."""
    return folder_of(module).split(".")[0]


NEVER = {("flight", "segmentation"), ("plot", "segmentation")}  # they know regions as polygons

# The floors of folders are a list of docs/architecture.md: a folder imports from floors below its own.

DOCUMENT = PACKAGE.parent / "docs" / "architecture.md"
FACES = {"uavseg", "xarray", "__main__"}  # nothing within imports them


def floors() -> dict[str, int]:
    """Number of the floor of each folder, 1 at the bottom; files beside the folders are on floor 0."""
    text = DOCUMENT.read_text(encoding="utf-8")
    rows = text.split("## Which way imports point")[1].split("```")[1].split("\n")[1:-1]
    below = {name: 0 for name in map(folder_of, modules()) if (PACKAGE / f"{name}.py").exists()}
    return below | {name: floor for floor, row in enumerate(rows[::-1], 1) for name in row.split()}


# Within segmentation, the phases take arrays: they import neither raster nor each other, except for these.

PHASES = {
    "params.segment": set(),
    "params.partition": {"params.segment"},
    "params.illumination": set(),
    "components": set(),
    "blocks.dilation": set(),
    "blocks.lbp": set(),
    "blocks.g_statistic": set(),
    "blocks.division": {"blocks.lbp", "blocks.g_statistic"},  # its kernel makes symbols
    "blocks.block_map": {"blocks.division", "params.segment"},
    "blocks.leaves": {"blocks.block_map", "params.segment", "params.partition"},
    "blocks.cell_pairs": {"blocks.block_map", "params.segment"},
    "refine.noise": {"blocks.dilation"},
    "refine.specks": set(),
    "refine.total_variation": {"blocks.dilation", "refine.noise", "refine.specks"},
    "refine.detail": {"blocks.dilation", "refine.noise"},
    "refine.range_scans": {"blocks.dilation"},
    "states.state_scans": set(),
    "states.obstacle_evidence": {"params.segment"},
    "sample.g_scores": {"blocks.lbp", "blocks.g_statistic"},
    "sample.pixel_decision": {"blocks.dilation", "sample.g_scores", "blocks.lbp"},
    "sample.mixture": set(),
    "sample.similarity_table": {"sample.mixture"},
}
EVERY_PHASE = set(PHASES)
PHASES["in_memory"] = EVERY_PHASE  # the phases one by one, for notebooks
PHASES["lbpc"] = EVERY_PHASE | {"in_memory"}  # a method of its own, made of them
ON_RASTERS = {  # these may import raster, and all phases
    "source",
    "pipeline",
    "blocks.block_file",
    "states.state_image",
    "states.classify_strips",
    "states.thin_structures",
    "range_choice",
}

# Packages, and the only places that import them (for more than types).

ONLY_IN = {
    "rasterio": {"raster", "jobs.web_map.content"},
    "pyproj": {  # CRS, zeros of heights; a local plane, an exception
        *("raster.geodesy.globe", "raster.elevation.dem", "flight.mission.track", "regions.formats.read"),
        "regions.formats.metadata",  # CRS in other words than WKT
    },
    "rio_tiler": {"jobs.web_map.content"},
    "numba": {"_jit.compiling", "_jit.kernels"},
    "llvmlite": {"_jit.compiling", "_jit.kernels"},
    "geopandas": {"regions", "flight.mission.features"},
    "pandas": {"regions"},
    "pymavlink": {"flight.link"},
    "serial": {"flight.link.transport"},
    "pyulog": {"flight.link.logs"},
    "dask": {"execution.cluster"},
    "distributed": {"execution.cluster"},
    "click": {"cli"},
    "matplotlib": {"plot"},
    "rosbags": {"occupancy.bags"},
    "anywidget": {"api.widget"},
    "skimage": {"segmentation.sample", "occupancy.paths.find_path", "regions.recognise"},
    "xarray": {"xarray"},
    "apsw": {"occupancy.bags"},
    "lz4": {"occupancy.bags"},
    "PIL": {"photographs", "plot", "segmentation.blocks.block_map"},
    "defusedxml": {"photographs"},
    "exactextract": {"jobs.result"},
}


@pytest.mark.slow
def test_some_packages_never_import_each_other() -> None:
    pairs = {
        (package_of(found.importer), package_of(found.imported))
        for found in imports()
        if found.imported in modules()
    }
    assert not pairs & NEVER


def test_folders_import_from_floors_below() -> None:
    floor = floors()
    files = {name for name, path in modules().items() if path.name != "__init__.py"}
    assert set(floor) | FACES == set(map(folder_of, files)) | FACES
    wrong = {
        f"{one.importer} imports {one.imported}"
        for one in imports()
        if one.imported in modules()
        and (importer := folder_of(one.importer)) not in FACES
        and (imported := folder_of(one.imported)) not in ("uavseg", importer)
        and (imported in FACES or floor[imported] >= max(floor[importer], 1))
    }
    assert not wrong


def test_phases_of_segmentation_stand_alone() -> None:
    wrong = set()
    for found in imports():
        phase = found.importer.removeprefix("uavseg.segmentation.")
        if package_of(found.importer) != "segmentation" or phase in ON_RASTERS:
            continue
        allowed = {f"uavseg.segmentation.{name}" for name in PHASES.get(phase, set())} | {
            "uavseg.arguments",
            "uavseg.arrays",
            "uavseg.errors",
            "uavseg.dataclass",
            "uavseg.units",
            "uavseg.warning_filters",
            "uavseg._jit",
        }
        if found.imported.startswith("uavseg") and found.imported not in allowed:
            wrong.add(f"{found.importer} imports {found.imported}")
    assert not wrong


@pytest.mark.parametrize("package", ONLY_IN)
def test_a_package_is_imported_where_it_belongs(package: str) -> None:
    places = tuple(f"uavseg.{place}" for place in ONLY_IN[package])
    wrong = {
        found.importer
        for found in imports()
        if found.imported.split(".")[0] == package
        and not found.for_types
        and not f"{found.importer}.".startswith(tuple(f"{place}." for place in places))
    }
    assert not wrong


def test_no_modules_import_each_other_in_a_circle() -> None:
    graph: dict[str, set[str]] = {name: set() for name in modules()}
    for found in imports():
        if found.now and found.imported in graph:
            graph[found.importer].add(found.imported)
    assert len(list(TopologicalSorter(graph).static_order())) == len(graph)


def test_commands_import_only_click_before_they_are_called() -> None:
    wrong = {
        f"{found.importer} imports {found.imported}"
        for found in imports()
        if package_of(found.importer) in ("cli", "__main__")
        and found.now
        and not found.imported.startswith(
            (
                "uavseg.cli",
                "uavseg.dataclass",
                "uavseg.errors",
                "uavseg.options",
                "uavseg.plain_text",
                "click",
            )
        )
        and found.imported.split(".")[0] not in sys.stdlib_module_names
    }
    assert not wrong


def test_the_imports_are_seen() -> None:
    seen = {(found.importer, found.imported) for found in imports()}
    assert ("uavseg.cli.preview", "uavseg.jobs.info") in seen  # in a function
    assert ("uavseg.raster.grid.tiling", "uavseg.execution.executors") in seen
    assert (
        "uavseg.raster.access.open_checked",
        "uavseg.raster.access.untrusted",
    ) in seen  # from a package import a module


def loaded_by(program: str) -> set[str]:
    """Top-level packages that a program has loaded at its end."""
    return {name.split(".")[0] for name in modules_loaded_by(program)}


def modules_loaded_by(program: str) -> set[str]:
    """Modules that a program has loaded at its end."""
    script = f"{program}\nimport sys; print('\\n' + ' '.join(sys.modules))"
    search = os.pathsep.join([str(PACKAGE.parent), os.environ.get("PYTHONPATH", "")])
    run = subprocess.run(
        [sys.executable, "-c", script],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "PYTHONPATH": search},
    )
    assert run.returncode == 0, run.stderr
    return set(run.stdout.splitlines()[-1].split())


def test_importing_the_package_brings_in_nothing_heavy() -> None:
    assert not loaded_by("import uavseg") & (HEAVY | {"click"})


def test_importing_the_command_line_brings_in_click_and_nothing_heavy() -> None:
    loaded = loaded_by("import uavseg, uavseg.cli")
    assert "click" in loaded and not loaded & HEAVY


def test_help_brings_in_nothing_heavy() -> None:
    assert not loaded_by("from uavseg.cli import main; main(['--help'], standalone_mode=False)") & HEAVY


@pytest.mark.slow
def test_help_of_a_command_brings_in_nothing_heavy_but_numpy() -> None:
    program = (
        "from uavseg.cli import main\n"
        "for name in main.list_commands(None):\n"
        "    main([name, '--help'], standalone_mode=False)"
    )
    assert not loaded_by(program) & HEAVY - {"numpy"}  # which comes with the hook that tells of compiling


@pytest.mark.slow
def test_planning_over_a_file_of_regions_loads_no_tracer(tmp_path: Path) -> None:
    square = {
        "type": "Polygon",
        "coordinates": [[[8, 47], [8.001, 47], [8.001, 47.001], [8, 47.001], [8, 47]]],
    }
    feature = {"type": "Feature", "properties": {"id": 1}, "geometry": square}
    regions, mission = tmp_path / "regions.geojson", tmp_path / "fly.plan"
    regions.write_text(json.dumps({"type": "FeatureCollection", "features": [feature]}))
    words = ["plan", str(regions), "-o", str(mission), "--altitude", "60", "--home", "auto", "-q"]
    loaded = modules_loaded_by(f"from uavseg.cli import main; main({words!r}, standalone_mode=False)")
    assert mission.exists() and "uavseg.regions.table" in loaded
    assert not {name for name in loaded if name.startswith(("uavseg.regions.outline", "uavseg.segmentation"))}


def test_ros_maps_load_no_beams() -> None:
    loaded = modules_loaded_by("import uavseg.occupancy.ros, uavseg.occupancy.ros.ros_map")
    assert "uavseg.occupancy.ros.ros_map" in loaded
    assert not {name for name in loaded if name.startswith("uavseg.occupancy.mapping")}


def test_public_words_are_there_when_they_are_used() -> None:
    for word in uavseg.__all__:
        assert getattr(uavseg, word) is not None
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        uavseg.nothing  # noqa: B018


FEW_USERS = ("uavseg.segmentation.lbpc", "uavseg.occupancy.simulation", "uavseg.occupancy.bags")


@pytest.mark.slow
@pytest.mark.parametrize("name", ["a.geojson", "a.kml"])
def test_extracting_loads_neither_tables_nor_filters(name: str, tmp_path: Path) -> None:
    raster, output = PACKAGE.parent / "samples" / "quarry.tif", tmp_path / name
    words = ["extract", str(raster), "--range", "0.55,1", "-o", str(output), "-q"]
    loaded = modules_loaded_by(f"from uavseg.cli import main; main({words!r}, standalone_mode=False)")
    assert output.exists() and "uavseg.regions.table" in loaded
    others = {"pandas", "geopandas", "pyogrio", "pyarrow", "skimage", "scipy", "matplotlib", "pymavlink"}
    assert not {module.split(".")[0] for module in loaded} & others
    assert not {module for module in loaded if module.startswith(FEW_USERS)}


@pytest.mark.slow
def test_what_few_use_is_not_loaded_by_what_many_use(tmp_path: Path) -> None:
    raster, regions, fly = PACKAGE.parent / "samples" / "quarry.tif", tmp_path / "a.gpkg", tmp_path / "a.plan"
    lines = [
        ["info", str(raster)],
        ["suggest", str(raster)],
        ["extract", str(raster), "--range", "0.55,1", "-o", str(regions), "-q"],
        ["plan", str(regions), "-o", str(fly), "--altitude", "60", "--home", "auto", "-q"],
        ["check", str(fly)],
        ["preview", str(raster), "--regions", str(regions), "-o", str(tmp_path / "a.png"), "-q"],
    ]
    calls = (f"main({words!r}, standalone_mode=False)" for words in lines)
    loaded = modules_loaded_by("\n".join(["from uavseg.cli import main", *calls]))
    assert "uavseg.plot.preview" in loaded
    assert not {module for module in loaded if module.startswith((*FEW_USERS, "rosbags", "skimage"))}
