"""The page: the scene, the buttons, status texts and plots.

It is made before the run begins and drawn by ``show``; nothing here reads time or decides when to draw.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from mbf_abstract.executives.tree_drawing import svg_of
from mbf_abstract.geometry.tilt import tilt_of
from terrain.session.goal_sequence import GoalSequence
from terrain.session.session import Session
from terrain.viewer.live.cameras import Cameras
from terrain.viewer.live.controls import LiveControls
from terrain.viewer.live.ground import Ground
from terrain.viewer.live.log import SPAN, LiveLog, recent
from terrain.viewer.live.moving import MovingThings
from terrain.viewer.live.panel import DrivePanel, FaultPanel
from terrain.viewer.live.plots import History, Plots
from terrain.viewer.live.readout import Readout
from terrain.viewer.live.status_html import SMALL, actions_html, headline_html, lines_html
from terrain.viewer.live.stick import Stick
from terrain.viewer.live.visitors import Visitors
from terrain.viewer.live.waypoint_list import WaypointList
from terrain.viewer.reports.timeline import PANEL, timeline_svg
from terrain.viewer.reports.tree_html import tree_html, worth_showing
from terrain.viewer.scene import add_surroundings, pin_height
from terrain.viewer.server.visitor_channel import VisitorChannel

PANEL_WIDTH = 320  # pixels
FARTHER = 1.6  # than in a replay, because the panels leave less room for the scene and the labels at its ends
NO_TREE = "No behaviour tree runs; start with --executive navigation to see one."
PLOT_EVERY = 5  # frames


class LivePage:
    """Everything that a visitor sees.

    Parameters
    ----------
    channel : VisitorChannel
        Of the server.
    steered : bool
        Whether the page may steer; else there are no buttons, and the choices of the view are disabled.
    """

    def __init__(
        self,
        server_page: Any,
        session: Session,
        sequence: GoalSequence,
        controls: LiveControls,
        log: LiveLog,
        stick: Stick,
        channel: VisitorChannel,
        steered: bool = True,
    ) -> None:
        self._server = server_page
        self._session = session
        self._sequence = sequence
        self._log = log
        self._frame = 0
        gui, start = server_page.gui, session.recorder.finish()
        gui.configure_theme(show_logo=False, show_share_button=False)
        add_surroundings(server_page.scene, start)
        cameras = Cameras(server_page, start, session.world.ground, controls.ground_rays, FARTHER)
        readout = Readout(session.navigator.server)
        self._visitors = Visitors(server_page, channel, controls, stick, cameras, readout)
        with gui.add_folder("Drive"):
            self._headline = gui.add_html("")
            self._drive = DrivePanel(server_page, controls, stick, session) if steered else None
        self._waypoints = WaypointList(server_page, controls, sequence, pin_height(start)) if steered else None
        with gui.add_folder("Show"):
            self._ground = Ground(server_page, session.navigator.server, session.world.ground)
            self.things = MovingThings(server_page, session, pin_height(start))
        if steered:
            with gui.add_folder("Fault", expand_by_default=False):
                FaultPanel(server_page, controls, session)
        else:
            for control in gui._gui_input_handle_from_uuid.values():
                control.disabled = True
        self._add_left_panel(gui)

    @property
    def is_watched(self) -> bool:
        """Whether a browser shows the page."""
        return bool(self._server.get_clients())

    def show(self, time: float, history: History) -> None:
        """Draw the present state; ``time`` is simulated time [s]."""
        with self._server.atomic():
            self.things.show(time, self._status(time), is_driving=self._sequence.target is not None)
            self._visitors.show(np.array(self._session.simulation.robot.pose().position))
            self._ground.show()
            if self._drive is not None:
                self._drive.show()
            if self._waypoints is not None:
                self._waypoints.show()
            self._show_texts(time)
            if self._frame % PLOT_EVERY == 0:
                self._plots.show(history)
                self._show_timeline(time)
        self._frame += 1

    def _add_left_panel(self, gui: Any) -> None:
        self._server.gui.main_panel.dock_right()
        self._server.gui.main_panel.set_width(PANEL_WIDTH)
        panel = gui.add_panel()
        with panel.add_tab("Status"):
            with gui.add_folder("Actions"):
                self._actions = gui.add_html("")
            with gui.add_folder("Last two minutes"):
                self._timeline = gui.add_html("")
                self._plots = Plots(gui)
            with gui.add_folder("Behaviour tree"):
                self._tree = gui.add_html("")
            with gui.add_folder("Log, newest first"):
                self._lines = gui.add_html("")
        panel.dock_left()
        panel.set_width(PANEL_WIDTH)

    def _show_texts(self, time: float) -> None:
        snapshot = self._log.snapshot()
        tree = tree_html(snapshot.nodes) if snapshot.nodes else NO_TREE
        for element, content in (
            (self._headline, headline_html(time, self._sequence)),
            (self._actions, actions_html(self._session.navigator.server, snapshot)),
            (self._tree, f'<div style="{SMALL}">{tree}</div>'),
            (self._lines, lines_html(snapshot.lines)),
        ):
            if element.content != content:
                element.content = content

    def _show_timeline(self, time: float) -> None:
        """The actions as bars, and the tree as a graph."""
        snapshot, begin = self._log.snapshot(), max(time - SPAN, 0.0)
        bars = timeline_svg(tuple(recent(snapshot.timeline, begin)), begin, time, PANEL)
        content = f'<div style="padding:0 0.8em">{bars}</div>'
        if self._timeline.content != content:
            self._timeline.content = content
        self._visitors.show_tree(svg_of(list(worth_showing(snapshot.nodes))) if snapshot.nodes else "")

    def _status(self, time: float) -> str:
        """Text above the robot."""
        robot = self._session.simulation.robot
        return f"{time:.0f} s   {robot.velocity().speed:.1f} m/s   tilt {math.degrees(tilt_of(robot.pose())):.0f}°"
