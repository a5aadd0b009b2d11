"""Encounters with what moves by itself: gaps between outlines, near misses, and who moved."""

import math
from dataclasses import dataclass, field

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mbf_abstract.geometry import Pose, Twist
from terrain.physics.actors import RouteWalker, SlidingDoor, other_robot
from terrain.physics.contact_depth import gap_to_polygon, placed
from terrain.physics.encounters import Mover, Surroundings
from terrain.physics.incidents import IncidentKind, IncidentMonitor
from terrain.physics.kinematic_robot import KinematicRobot
from terrain.physics.kinematic_world import KinematicWorld
from terrain.physics.motion_sample import MotionSample, Other, Thing
from terrain.physics.robot_models import HUSKY, TURTLEBOT
from terrain.physics.simulation import Simulation
from terrain.worlds.surface import cylinder

PERIOD = 0.05  # s
STILL = Twist()
BOX = np.array([[-0.5, -0.3], [0.5, -0.3], [0.5, 0.3], [-0.5, 0.3]])
angles = st.floats(-math.pi, math.pi)
offsets = st.floats(-2.0, 2.0)


@dataclass
class Figure:
    """An actor that is put somewhere."""

    place: Pose
    thing: Thing = Thing.PERSON
    size: tuple[float, ...] = (0.25, 1.7)
    looks: object = field(default_factory=lambda: cylinder(0.25, 1.7))

    def pose(self) -> Pose:
        return self.place


def points_of(corners, count=60):
    """Points all along an outline."""
    along = np.linspace(0.0, 1.0, count)[:, None]
    return np.concatenate([a + along * (b - a) for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True)])


@given(offsets, offsets, angles, angles)
def test_the_gap_of_two_outlines_is_that_of_their_nearest_points(x, y, yaw, other_yaw):
    ours, theirs = placed(BOX, 0.0, 0.0, yaw), placed(BOX, x, y, other_yaw)

    gap = gap_to_polygon(ours, theirs)

    if gap > 0.0:
        apart = points_of(ours)[:, None] - points_of(theirs)
        assert gap == pytest.approx(np.hypot(apart[..., 0], apart[..., 1]).min(), abs=0.02)
    assert gap == pytest.approx(gap_to_polygon(theirs, ours), abs=1e-9)


def test_outlines_that_overlap_have_no_gap():
    assert gap_to_polygon(BOX, placed(BOX, 0.3, 0.2, 0.5)) == 0.0
    assert gap_to_polygon(BOX, placed(0.1 * BOX, 0.0, 0.0, 0.5)) == 0.0


def test_the_others_have_names_gaps_and_speeds():
    first, second, door = (Figure(Pose.planar(x, 0.0, z=0.85)) for x in (1.0, 3.0, -1.0))
    door.thing, door.size = Thing.DOOR, (0.2, 1.0, 2.0)
    surroundings = Surroundings(TURTLEBOT, [first, second, door])
    radius = TURTLEBOT.circumscribed_radius

    start = surroundings.look(Pose.planar(0.0, 0.0))
    first.place = Pose.planar(0.96, 0.0, z=0.85)
    later = surroundings.look(Pose.planar(0.0, 0.0).stamped(PERIOD))

    assert [(other.name, other.thing) for other in start] == [("person 1", Thing.PERSON), ("door 1", Thing.DOOR)]
    assert start[0].gap == pytest.approx(1.0 - 0.25 - radius, abs=0.03)
    assert [other.speed for other in start] == [0.0, 0.0]
    assert [other.speed for other in later] == pytest.approx([0.8, 0.0])


def test_who_stands_a_storey_above_is_not_near():
    assert Surroundings(HUSKY, [Figure(Pose.planar(0.0, 0.0, z=3.85))]).look(Pose.planar(0.0, 0.0)) == ()


def encounter(gaps, speed=1.0, commanded=STILL, touched_below=-1.0):
    """Incidents of a robot that a person comes near to, sample by sample."""
    monitor, found = IncidentMonitor(), []
    for step, gap in enumerate(gaps):
        touched = frozenset({Thing.PERSON} if gap <= touched_below else ())
        others = (Other("person 1", Thing.PERSON, gap, speed),)
        pose = Pose.planar(0.0, 0.0).stamped(PERIOD * step)
        found += monitor.update(MotionSample(pose, commanded, commanded, commanded, touched=touched, others=others))
    return found


PASSING = [0.5, 0.3, 0.15, 0.12, 0.14, 0.19, 0.26, 0.4]


def test_a_near_miss_counts_once_with_its_smallest_gap():
    (incident,) = encounter(PASSING)

    assert (incident.kind, incident.other.gap, incident.moved) == (IncidentKind.NEAR_MISS, 0.12, Mover.OTHER)


@pytest.mark.parametrize(
    ("gaps", "count"),
    [
        ([0.5, 0.3, 0.21, 0.3, 0.5], 0),
        ([*PASSING, *PASSING], 2),
        ([0.5, 0.15, 0.21, 0.15, 0.21, 0.15, 0.5], 1),
        ([0.5, 0.15, 0.15, 0.15], 0),
    ],
    ids=["kept away", "came twice", "dithered", "has not passed yet"],
)
def test_an_approach_is_a_near_miss_when_it_is_over(gaps, count):
    assert len(encounter(gaps)) == count


def test_a_contact_is_a_collision_and_no_near_miss():
    kinds = [incident.kind for incident in encounter([0.3, 0.15, 0.0, 0.1, 0.3, 0.6], touched_below=0.0)]

    assert kinds == [IncidentKind.COLLISION, IncidentKind.COLLISION_WITH_PERSON]


def test_two_that_stand_beside_each_other_have_not_missed_each_other():
    assert encounter([0.1] * 20 + [0.5], speed=0.0) == []


@pytest.mark.parametrize("kind", [0.0, -1.0], ids=["contact", "near miss"])
@given(speed=st.floats(0.0, 3.0), closest=st.floats(0.0, 0.15))
def test_a_robot_that_stands_is_never_who_moved(kind, speed, closest):
    incidents = encounter([0.5, closest, 0.5], speed, touched_below=kind + closest)
    assert incidents or speed < 0.05, "two that stand"
    assert {incident.moved for incident in incidents} <= {Mover.OTHER, Mover.NEITHER}


@pytest.mark.parametrize(
    ("commanded", "speed", "moved"),
    [(0.3, 0.0, Mover.ROBOT), (0.0, 0.8, Mover.OTHER), (0.3, 0.8, Mover.BOTH), (0.0, 0.0, Mover.NEITHER)],
)
def test_a_contact_names_who_moved_into_whom(commanded, speed, moved):
    found = encounter([0.3, 0.0], speed, Twist.planar(commanded), touched_below=0.0)

    assert {incident.moved for incident in found} == {moved}
    assert {incident.other.name for incident in found} == {"person 1"}


@pytest.mark.parametrize("make", ["walker", "robot", "door"])
def test_what_runs_into_a_standing_robot_is_named_with_its_speed_and_at_fault(make):
    world, route = KinematicWorld(), [[3.0, 0.0], [-3.0, 0.0]]
    if make == "walker":
        actor = RouteWalker(world, route, 0.7)
    elif make == "robot":
        actor = other_robot(world, TURTLEBOT, route, 0.7)
    else:
        ends = (Pose.planar(x, 0.0, z=1.0) for x in (3.0, -3.0))
        actor = SlidingDoor(world, *ends, (0.1, 1.0, 2.0), closes_at=0.0, duration=6.0 / 0.7)
    robot = KinematicRobot(world, TURTLEBOT, Pose.planar(0.0, 0.0))
    simulation = Simulation(world, robot, actors=[actor])
    heard = []
    simulation.on_incident.append(heard.append)
    simulation.advance_to(5.0)

    contact = next(incident for incident in simulation.incidents if incident.kind.value.startswith("collision_with"))
    data = contact.to_json()
    assert (data["moved"], data["other"]) == ("other", f"{actor.thing.value} 1")
    assert data["other_speed"] == pytest.approx(0.7, abs=0.02) and data["robot_speed"] == 0.0
    assert heard == simulation.incidents
    assert IncidentKind.COLLISION_WHILE_MOVING not in simulation.monitor.counts


def test_a_robot_that_drives_into_a_person_is_at_fault_at_the_speed_it_had():
    world = KinematicWorld()
    person = RouteWalker(world, [[1.5, 0.0]], 0.0)
    robot = KinematicRobot(world, TURTLEBOT, Pose.planar(0.0, 0.0), command_timeout=math.inf)
    simulation = Simulation(world, robot, actors=[person])
    robot.send_command(Twist.planar(0.4))
    simulation.advance_to(6.0)

    (contact,) = [i for i in simulation.incidents if i.kind is IncidentKind.COLLISION_WITH_PERSON]
    assert (contact.moved, contact.other.name) == (Mover.ROBOT, "person 1")
    assert contact.speed == pytest.approx(0.4)
