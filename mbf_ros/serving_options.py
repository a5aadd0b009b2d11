"""Options that the commands share which serve a navigator to clients of ROS."""

from __future__ import annotations

import typer

SENSOR_TEXT = "TOPIC:TYPE=SOURCE of a sensor of the robot, with its source in CONFIG; may be repeated."
USUAL_SENSORS = ["scan:LaserScan=scan", "points:PointCloud2=points", "range:Range=range"]
NODE_SENSORS = typer.Option(USUAL_SENSORS, "--sensor", help=SENSOR_TEXT)
SENSORS = typer.Option([f"/{sensor}" for sensor in USUAL_SENSORS], "--sensor", help=SENSOR_TEXT)
STAMPED = typer.Option(False, "--stamped", help="Publish /cmd_vel as TwistStamped.")
MAX_SILENCE = typer.Option(
    0.0,
    "--max-silence",
    min=0.0,
    help="Time without odometry, transforms or a sensor at which the robot stops, in s; 0 = command_timeout.",
)
KEEP_GOALS = typer.Option(False, "--keep-goals", help="A goal goes on when its client is gone; else it is canceled.")
MAP_PERIOD = typer.Option(
    1.0, "--map-period", min=0.05, help="Least time between two messages of a costmap or a mesh, in s."
)
