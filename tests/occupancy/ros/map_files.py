"""YAML and image files of ROS maps, and a transcription of Nav2's rules."""

from pathlib import Path
from typing import Any

import numpy as np

from uavseg.occupancy.ros.ros_map import pgm_bytes


def yaml_text(**keys: Any) -> str:
    usual = {
        "image": "map.pgm",
        "resolution": 0.05,
        "origin": "[-1.0, 2.0, 0.0]",
        "negate": 0,
        "occupied_thresh": 0.65,
        "free_thresh": 0.196,
    }
    return "".join(f"{key}: {value}\n" for key, value in (usual | keys).items() if value is not None)


def put(folder: Path, grey: np.ndarray, **keys: Any) -> Path:
    (folder / "map.pgm").write_bytes(pgm_bytes(grey))
    (folder / "map.yaml").write_text(yaml_text(**keys))
    return folder / "map.yaml"


ALL = np.arange(256, dtype=np.uint8).reshape(16, 16)
