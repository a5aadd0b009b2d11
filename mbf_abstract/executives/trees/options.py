"""Options of the reference trees: names of plugins and limits; see ``reference_trees``."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class TreeOptions:
    """Names of plugins and limits of the reference trees.

    The defaults are those that the experiment of Table I measures (``mbf bench table1``), but for ``progress_timeout``,
    which is off there.

    Attributes
    ----------
    planner, second_planner, controller : str
        Empty = the first one loaded.
    refiner : str
        Every plan goes through it; empty = none.
    clear, out_of_collision, relax_planner, relax_controller, move_away : str
        Recovery behaviours by what they are for; empty = none.
    escape : str
        Leads a robot off ground that is closed to it, where no plan begins; empty = none.
    wait, give_way : str
        Where a tracked object blocks the path: ``wait`` for one that moves, and no second planner, but for one that
        goes along the path slowly and has room beside it (``overtaking.py``); around one that stands, once this
        robot has come near, creeps, or its controller refuses, a plan, which is taken where it is no more than
        ``longest_update`` or a few metres longer; then ``wait`` twice, then ``give_way``. ``give_way`` comes at
        once before one that came along the path, or moved and has stood for 6 s, or for 10 s where it went where
        the robot goes, and may queue there: it waits for the robot, too, and may have turned round on the spot; one
        that is parked is planned around at once. A path that is blocked by nobody has ``move_away`` as its last
        recovery, too. Empty, the default: nobody asks.
    check_poses : bool
        Whether navigation first looks whether robot and goal stand free.
    second_planner_pause : float
        Pause of the second planner between two of its plans [s]; 0 = no second planner. With ``wait`` it looks at the
        path more often, and the pause is that after a path around somebody that was too long to be taken.
    second_planner_look_ahead : float
        The second planner plans only where the path is blocked within this length [m] ahead; 0 = in any case.
    longest_update : float
        The second planner's path is taken up to this many times the length of what is left of the present one.
    control_retries : int
        Recoveries of driving before the tree falls back to planning.
    replans : int
        How often the tree falls back to planning before it gives up.
    reuse_path : bool
        Drive on along the same path after a recovery; otherwise plan anew after each failure of driving.
    by_outcome : bool
        Pick recoveries of driving by outcome code; otherwise take them in turn.
    progress_timeout, oscillation_timeout, motor_timeout : float
        Limits of the watchdogs [s]; 0 = off.
    """

    planner: str = ""
    second_planner: str = ""
    controller: str = ""
    refiner: str = ""
    clear: str = "clear"
    out_of_collision: str = "back_up"
    relax_planner: str = ""
    relax_controller: str = ""
    move_away: str = ""
    escape: str = ""
    wait: str = ""
    give_way: str = ""
    check_poses: bool = True
    second_planner_pause: float = 8.0
    second_planner_look_ahead: float = 3.0
    longest_update: float = 1.5
    control_retries: int = 8
    replans: int = 3
    reuse_path: bool = True
    by_outcome: bool = True
    progress_timeout: float = 20.0
    oscillation_timeout: float = 0.0
    motor_timeout: float = 0.0
