"""Message packages without wheels as interface files of ROS 2, made of the fields in ``interfaces.txt``.

Names, types and the order of fields are those of the released packages, so both have the same RIHS01 hashes and speak
to each other. Of tf2_msgs only TFMessage is here, of nav2_msgs what the node offers, and mbf_msgs has no
``SetTestRobotState``. Fields of nav2_msgs differ by distribution; those of Jazzy are in ``nav2_jazzy.txt``. Constants
and defaults are not part of a hash; those of results of mbf_msgs are our outcomes.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import IntEnum
from functools import cache
from importlib.resources import files

from mbf_abstract.maps.queries import CellState
from mbf_abstract.outcomes import ExePathOutcome, GetPathOutcome, MoveBaseOutcome, RecoveryOutcome
from mbf_ros.messages.interfaces import Field, fields_of, known_types, types_in
from mbf_ros.messages.mbf_queries import GLOBAL_COSTMAP, LOCAL_COSTMAP
from mbf_ros.messages.nav2 import codes as nav2_codes

KILTED, JAZZY = "kilted", "jazzy"
"""Distributions whose packages are known."""
PACKAGES = ("map_msgs", "mbf_msgs", "mesh_msgs", "nav2_msgs", "tf2_msgs")
PARTS = {"msg": ("",), "srv": ("_Request", "_Response"), "action": ("_Goal", "_Result", "_Feedback")}
QUESTIONS = ("CheckPoint", "CheckPose", "CheckPath", "FindValidPose")
COSTMAPS = {"LOCAL_COSTMAP": LOCAL_COSTMAP, "GLOBAL_COSTMAP": GLOBAL_COSTMAP}

NAV2_CODES: dict[str, type[IntEnum]] = {
    "ComputePathToPose": nav2_codes.PlanningCode,
    "ComputePathThroughPoses": nav2_codes.ThroughPosesCode,
    "FollowPath": nav2_codes.FollowPathCode,
    "NavigateToPose": nav2_codes.NavigateCode,
    "NavigateThroughPoses": nav2_codes.NavigateThroughPosesCode,
    "FollowWaypoints": nav2_codes.WaypointsCode,
    "SmoothPath": nav2_codes.SmoothingCode,
    "Spin": nav2_codes.SpinCode,
    "BackUp": nav2_codes.BackUpCode,
    "DriveOnHeading": nav2_codes.DriveOnHeadingCode,
    "Wait": nav2_codes.WaitCode,
}


def _of_enum(enum: type[IntEnum]) -> dict[str, int]:
    return {one.name: int(one) for one in enum}


CONSTANTS: dict[str, tuple[str, Mapping[str, int]]] = {
    "mbf_msgs/action/GetPath_Result": ("uint32", _of_enum(GetPathOutcome)),
    "mbf_msgs/action/ExePath_Result": ("uint32", _of_enum(ExePathOutcome)),
    "mbf_msgs/action/Recovery_Result": ("uint32", _of_enum(RecoveryOutcome)),
    "mbf_msgs/action/MoveBase_Result": ("uint32", _of_enum(MoveBaseOutcome)),
    **{f"mbf_msgs/srv/{name}_Request": ("uint8", COSTMAPS) for name in QUESTIONS},
    **{f"mbf_msgs/srv/{name}_Response": ("uint8", _of_enum(CellState)) for name in QUESTIONS},
    **{
        f"nav2_msgs/action/{name}_Result": ("uint16", {"NONE": 0, **_of_enum(codes)})
        for name, codes in NAV2_CODES.items()
    },
    "nav2_msgs/msg/WaypointStatus": ("uint8", _of_enum(nav2_codes.WaypointState)),
}
"""Type and values of the constants of a part, by its name."""


@cache
def types_of(distribution: str) -> Mapping[str, tuple[Field, ...]]:
    """Return the fields of all types of a distribution, by name."""
    types = {name: fields_of(name) for name in known_types()}
    if distribution == JAZZY:
        types |= types_in(files(__package__).joinpath("nav2_jazzy.txt").read_text("utf-8"))
        del types["nav2_msgs/msg/WaypointStatus"]
    return types


def interface_files(package: str, distribution: str = KILTED) -> dict[str, str]:
    """Return the text of each interface file of a package, by its path in it, e.g. ``action/GetPath.action``."""
    types = types_of(distribution)
    interfaces = dict.fromkeys(
        (kind, name.partition("_")[0]) for owner, kind, name in (one.split("/") for one in types) if owner == package
    )
    return {
        f"{kind}/{name}.{kind}": "---\n".join(_part(f"{package}/{kind}/{name}{part}", types) for part in PARTS[kind])
        for kind, name in interfaces
    }


def used_packages(package: str, distribution: str = KILTED) -> tuple[str, ...]:
    """Return the names of the other packages that a package needs, also through others, sorted."""
    all_types = types_of(distribution)
    found: set[str] = set()
    todo = [name for name in all_types if name.startswith(f"{package}/")]
    while todo:
        types = {field.type for field in all_types[todo.pop()] if "/" in field.type}
        todo += [name for name in types if name.partition("/")[0] not in found]
        found |= {name.partition("/")[0] for name in types}
    if any(path.startswith(("action/", "srv/")) for path in interface_files(package, distribution)):
        found |= {"action_msgs", "service_msgs", "unique_identifier_msgs", "builtin_interfaces"}
    return tuple(sorted(found - {package}))


def _part(name: str, types: Mapping[str, tuple[Field, ...]]) -> str:
    """The lines of one part of an interface; none of a feedback without fields."""
    kind, constants = CONSTANTS.get(name, ("", {}))
    fields = types.get(name, ())
    lines = [f"{kind} {constant} = {value}" for constant, value in constants.items()]
    return "".join(f"{line}\n" for line in (*lines, *map(_line, fields)))


def _line(field: Field) -> str:
    brackets = "" if field.length is None else f"[{field.length or ''}]"
    default = f" {field.default:g}" if field.default else ""
    return f"{field.type}{brackets} {field.name}{default}".replace("/msg/", "/")
