"""Install the package as ament_python does; name and version are those of package.xml."""

from pathlib import Path
from xml.etree import ElementTree

from setuptools import setup

package = ElementTree.parse(Path(__file__).with_name("package.xml")).getroot()
name = package.findtext("name")

setup(
    name=name,
    version=package.findtext("version"),
    description=package.findtext("description"),
    license=package.findtext("license"),
    maintainer=package.findtext("maintainer"),
    maintainer_email=package.find("maintainer").get("email"),
    packages=[name],
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{name}"]),
        (f"share/{name}", ["package.xml"]),
        (f"share/{name}/config", [f"config/{name}.yaml"]),
        (f"share/{name}/launch", [f"launch/{name}.launch.py"]),
    ],
    install_requires=["setuptools"],  # uavseg is installed beside it, see README.md
    zip_safe=True,
    entry_points={
        "console_scripts": [
            f"map_node = {name}.node:main",
            f"route_graph = {name}.route_graph:main",
            f"cover = {name}.cover:main",
        ]
    },
)
