"""The ROS package as colcon, rosdep and ros2 launch see it."""

import ast
import re
import runpy
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path
from types import ModuleType
from typing import Any
from xml.etree import ElementTree

import pytest
import yaml
from uavseg_ros import cover, route_graph
from uavseg_ros.parameters import descriptions

import uavseg
from tests.ros.robots import invoke

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = ROOT / "ros" / "uavseg_ros"
XML = ElementTree.parse(PACKAGE / "package.xml").getroot()
PROJECT: dict[str, Any] = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
KEYS = {"tf2_ros": "tf2_ros_py", "numpy": "python3-numpy"}  # rosdep keys that differ from the module
FROM_PIP = {"uavseg", "click", "rasterio", "scipy", "shapely"}  # uavseg brings the others
LAUNCHED = {
    "launch": ["LaunchDescription"],
    "launch.actions": ["DeclareLaunchArgument", "EmitEvent", "RegisterEventHandler"],
    "launch.conditions": ["IfCondition"],
    "launch.events": ["matches_action"],
    "launch.substitutions": ["LaunchConfiguration", "PathJoinSubstitution"],
    "launch_ros": [],
    "launch_ros.actions": ["LifecycleNode"],
    "launch_ros.event_handlers": ["OnStateTransition"],
    "launch_ros.events": [],
    "launch_ros.events.lifecycle": ["ChangeState"],
    "launch_ros.substitutions": ["FindPackageShare"],
    "lifecycle_msgs": [],
}


def imported() -> set[str]:
    """Top-level modules that the package imports, but for its own and those of Python."""
    files = [*PACKAGE.glob("uavseg_ros/*.py"), *PACKAGE.glob("launch/*.py")]
    nodes = [node for file in files for node in ast.walk(ast.parse(file.read_text()))]
    names = [alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names]
    names += [str(node.module) for node in nodes if isinstance(node, ast.ImportFrom)]
    return {name.split(".")[0] for name in names} - set(sys.stdlib_module_names) - {"uavseg_ros"}


def test_version_and_licence_are_those_of_uavseg() -> None:
    assert XML.get("format") == "3"
    assert XML.findtext("version") == uavseg.__version__
    assert XML.findtext("license") == PROJECT["license"]
    assert XML.findtext("export/build_type") == "ament_python"
    assert (PACKAGE / "resource" / str(XML.findtext("name"))).exists()


def test_each_import_has_a_rosdep_key_and_each_key_is_imported() -> None:
    keys = [str(node.text) for node in XML.iter("exec_depend")]
    assert sorted(set(keys)) == keys
    assert set(keys) == {KEYS.get(name, name) for name in imported() - FROM_PIP}


def test_catkin_pkg_finds_nothing_wrong() -> None:
    package = pytest.importorskip("catkin_pkg.package", reason="catkin_pkg is not installed")
    warnings: list[str] = []
    parsed = package.parse_package(str(PACKAGE), warnings=warnings)
    parsed.validate(warnings=warnings)
    assert not warnings and parsed.get_build_type() == "ament_python"


@pytest.mark.slow
def test_setup_installs_what_ros2_run_and_launch_look_for(tmp_path: Path) -> None:
    pytest.importorskip("setuptools", reason="setuptools is not installed")
    shutil.copytree(PACKAGE, tmp_path / "source")
    words = [
        "install",
        "--prefix",
        "/opt",
        "--root",
        str(tmp_path / "root"),
        "--single-version-externally-managed",
    ]
    ran = subprocess.run(
        [sys.executable, "-W", "ignore", "setup.py", *words],
        cwd=tmp_path / "source",
        capture_output=True,
        text=True,
    )
    assert ran.returncode == 0, ran.stderr
    root = tmp_path / "root" / "opt"
    for name in ("package.xml", "config/uavseg_ros.yaml", "launch/uavseg_ros.launch.py"):
        assert (root / "share" / "uavseg_ros" / name).read_text() == (PACKAGE / name).read_text()
    assert (root / "share" / "ament_index" / "resource_index" / "packages" / "uavseg_ros").exists()
    for name in ("map_node", "route_graph", "cover"):
        program = root / "lib" / "uavseg_ros" / name
        assert program.read_text().splitlines()[0] == "#!/usr/bin/env python3"
    [modules] = root.glob("lib/python*/site-packages/uavseg_ros")
    assert {file.name for file in modules.glob("*.py")} == {
        file.name for file in PACKAGE.glob("uavseg_ros/*.py")
    }
    [points] = root.glob("lib/python*/site-packages/*.egg-info/entry_points.txt")
    for name, module in (("map_node", "node"), ("route_graph", "route_graph"), ("cover", "cover")):
        assert f"{name} = uavseg_ros.{module}:main" in points.read_text()


class Recorded:
    """A stand-in for a class of launch, which keeps its arguments."""

    def __init__(self, *values: Any, **named: Any) -> None:
        self.kind, self.values, self.named = type(self).__name__, values, named


def launched(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """Run the launch file with stand-ins, and return the entities of its description."""
    transition = type("Transition", (), {"TRANSITION_CONFIGURE": 1, "TRANSITION_ACTIVATE": 3})
    modules = {name: dict.fromkeys(names) for name, names in LAUNCHED.items()}
    for name, names in [*modules.items(), ("lifecycle_msgs.msg", {"Transition": transition})]:
        module = ModuleType(name)
        for kind, value in names.items():
            setattr(module, kind, value or type(kind, (Recorded,), {}))
        monkeypatch.setitem(sys.modules, name, module)
    file = PACKAGE / "launch" / "uavseg_ros.launch.py"
    description = runpy.run_path(str(file))["generate_launch_description"]()
    assert description.kind == "LaunchDescription"
    entities: list[Any] = description.values[0]
    return entities


def test_the_launch_file_configures_and_activates_the_node_that_setup_installs(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    entities = launched(monkeypatch)
    [node] = [one for one in entities if one.kind == "LifecycleNode"]
    assert (node.named["package"], node.named["executable"]) == ("uavseg_ros", "map_node")
    [handler] = [one for one in entities if one.kind == "RegisterEventHandler"]
    [configure] = [one for one in entities if one.kind == "EmitEvent"]
    transition = handler.values[0].named
    assert (transition["start_state"], transition["goal_state"]) == ("configuring", "inactive")
    assert transition["target_lifecycle_node"] is node
    [activate] = transition["entities"]
    for event, number in ((configure, 1), (activate, 3)):
        change = event.named["event"]
        assert change.named["transition_id"] == number
        assert change.named["lifecycle_node_matcher"].values == (node,)
    assert entities.index(handler) < entities.index(node) < entities.index(configure)
    for one in (handler, configure):
        assert one.named["condition"].values[0].values == ("autostart",)


def test_each_argument_of_the_launch_file_is_declared_and_documented(monkeypatch: pytest.MonkeyPatch) -> None:
    entities = launched(monkeypatch)
    declared = {one.values[0] for one in entities if one.kind == "DeclareLaunchArgument"}
    text = (PACKAGE / "launch" / "uavseg_ros.launch.py").read_text()
    assert declared == set(re.findall(r'LaunchConfiguration\("(\w+)"\)', text))
    page = (ROOT / "docs" / "how-to" / "ros.md").read_text()
    assert declared == set(re.findall(r"^\| `(\w+):=", page, re.MULTILINE))


def test_the_documentation_has_each_parameter_with_its_default_and_description() -> None:
    page = (ROOT / "docs" / "how-to" / "ros.md").read_text()
    part = page.split("### Parameters")[1].split("\n### ")[0]
    rows = {
        found[0]: found[1:] for found in re.findall(r"^\| `(\w+)` \| (\S+) \| (.*) \|$", part, re.MULTILINE)
    }
    described = {name: (yaml.safe_load(default), text) for name, (default, text) in rows.items()}
    assert described == dict(descriptions())


@pytest.mark.slow
def test_the_programs_print_what_the_documentation_shows(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    page = (ROOT / "docs" / "how-to" / "ros.md").read_text()
    for code in re.findall(r"^```python\n(.*?)^```", page, re.DOTALL | re.MULTILINE):
        if "hall.yaml" in code or "stations.geojson" in code:
            exec(compile(code, "ros.md", "exec"), {})
    programs = {"route_graph": route_graph.command, "cover": cover.command}
    shown = 0
    for block in re.findall(r"^```console\n(\$ ros2 run uavseg_ros .*?)^```", page, re.DOTALL | re.MULTILINE):
        for line, printed in re.findall(r"^\$ (.*)\n((?:[^$].*\n)*)", block, re.MULTILINE):
            words = line.split()
            if words[0] == "cat":
                assert Path(words[1]).read_text() == printed
            else:
                assert invoke(programs[words[3]], *words[4:]).stderr == printed
            shown += 1
    assert shown == 5
