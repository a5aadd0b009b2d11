"""Every installed plugin keeps the contract: a new one is tested by being registered."""

import numpy as np
import pytest

from mbf_abstract.config.registry import PluginRegistry
from mbf_abstract.geometry import Path, Pose
from mbf_abstract.plugins import PlanRequest, PluginKind
from mbf_abstract.testing.contract import check_controller, check_planner, check_recovery, check_refiner
from mbf_abstract.testing.contract.rig import rig

EASY = (Pose.planar(1.0, 1.0), Pose.planar(3.0, 1.2))
AROUND_THE_WALL = (Pose.planar(1.0, 1.0), Pose.planar(7.0, 1.0, 1.0))
INTO_THE_CLOSET = (Pose.planar(1.0, 1.0), Pose.planar(7.2, 5.2))
STRAIGHT_PATH = Path.from_points(np.linspace((1.0, 1.0, 0.0), (3.0, 1.2, 0.0), 41))
NEEDS_PATH_OF = {"mesh.vector_field": "cvp"}  # a controller that follows what only this planner adds to its path
CANNOT_GO_AROUND = {"costmap.straight_line"}
CANCEL_WITHIN = 1.0  # s; the promise is 0.1 s of work, and this machine may be busy


def installed(kind):
    """All plugins of a kind that a backend offers, as (backend, short name)."""
    names = [(backend, name) for backend in ("costmap", "mesh") for name in PluginRegistry(backend).names(kind)]
    return [pytest.param(*pair, id=".".join(pair)) for pair in names]


def plan(backend, planner, make_context):
    """Path of a planner along the easy problem."""
    planner_class = PluginRegistry(backend).load(PluginKind.PLANNER, planner)
    with rig(planner_class, make_context, None, EASY[0]) as made:
        return made.plugin.make_plan(PlanRequest(*EASY)).path


@pytest.fixture
def site(request, backend):
    """The map of the backend."""
    return request.getfixturevalue(f"{backend}_site")


@pytest.mark.parametrize(("backend", "name"), installed(PluginKind.PLANNER))
def test_planner(backend, name, site):
    planner_class = PluginRegistry(backend).load(PluginKind.PLANNER, name)
    goes_around = f"{backend}.{name}" not in CANNOT_GO_AROUND
    check_planner(
        planner_class,
        [EASY, AROUND_THE_WALL] if goes_around else [EASY],
        make_context=site.make_context,
        unreachable=[INTO_THE_CLOSET] if goes_around else [INTO_THE_CLOSET, AROUND_THE_WALL],
        watched=site.watched,
        cancel_within=CANCEL_WITHIN,
    )


@pytest.mark.parametrize(("backend", "name"), installed(PluginKind.CONTROLLER))
def test_controller(backend, name, site):
    controller_class = PluginRegistry(backend).load(PluginKind.CONTROLLER, name)
    planner = NEEDS_PATH_OF.get(f"{backend}.{name}")
    check_controller(
        controller_class,
        plan(backend, planner, site.make_context) if planner else STRAIGHT_PATH,
        make_context=site.make_context,
        watched=site.watched,
        cancel_within=CANCEL_WITHIN,
    )


@pytest.mark.parametrize(("backend", "name"), installed(PluginKind.RECOVERY))
def test_recovery(backend, name, site):
    recovery_class = PluginRegistry(backend).load(PluginKind.RECOVERY, name)
    check_recovery(recovery_class, start=Pose.planar(2.0, 2.0), make_context=site.make_context)


@pytest.mark.parametrize(("backend", "name"), installed(PluginKind.REFINER))
def test_refiner(backend, name, site):
    refiner_class = PluginRegistry(backend).load(PluginKind.REFINER, name)
    check_refiner(refiner_class, STRAIGHT_PATH, make_context=site.make_context, watched=site.watched)


def test_every_installed_plugin_can_be_imported():
    broken = [entry for entry in PluginRegistry().entries() if entry.error]
    assert broken == []
