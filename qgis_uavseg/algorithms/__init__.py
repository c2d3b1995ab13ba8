"""Algorithms of the provider."""

from __future__ import annotations

from .check import CheckMission
from .classify import ClassifyMap
from .extract import ExtractRegions
from .levels import SegmentByLevels
from .match import RegionsLikeSample
from .path import FindPath
from .photographs import Footprints, Gaps, Georeference
from .plan import PlanMission
from .suggest import SuggestRanges
from .suggest_like import SuggestForSample

ALGORITHMS = (
    ExtractRegions,
    SegmentByLevels,
    RegionsLikeSample,
    SuggestRanges,
    SuggestForSample,
    PlanMission,
    CheckMission,
    Footprints,
    Gaps,
    Georeference,
    ClassifyMap,
    FindPath,
)
