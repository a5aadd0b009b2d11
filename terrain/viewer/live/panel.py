"""The buttons of the page: every one of them posts a command, see ``controls``, and does nothing else."""

from __future__ import annotations

import math
from typing import Any, get_args

from mbf_abstract.plugins import PluginKind
from terrain.scenarios.faults import LocalizationJump, SensorFault
from terrain.session.session import Session
from terrain.viewer.live.controls import LiveControls, Placing
from terrain.viewer.live.stick import Stick

JUMP = "localisation jumps"
SENSOR_FAULTS = tuple(get_args(SensorFault.model_fields["type"].annotation))
HINT = (
    "Click on the ground: the robot goes there. Drag with Shift: it arrives with that heading. Drag to turn the view, "
    "right button to move it, wheel to zoom."
)


class DrivePanel:
    """Goals: what a click is, cancel, pause, plugins, end."""

    def __init__(self, server_page: Any, controls: LiveControls, stick: Stick, session: Session) -> None:
        gui = server_page.gui
        self._controls, self._stick = controls, stick
        gui.add_markdown(HINT)
        self._placing = gui.add_dropdown(
            "a click is", tuple(placing.value for placing in Placing), hint="What a click or a drag with Shift places"
        )
        self._placing.on_update(self._take_placing)
        server_page.scene.on_click()(self._take_click)
        gui.add_button("Cancel", color="red", hint="End the present goal").on_click(
            lambda _: controls.post(controls.cancel)
        )
        self._hold = gui.add_button("Pause", hint="Hold the robot where it is; goals are kept")
        self._hold.on_click(self._take_hold)
        plugins = session.navigator.server.plugins
        self._planner = gui.add_dropdown("planner", plugins.names(PluginKind.PLANNER))
        self._controller = gui.add_dropdown("controller", plugins.names(PluginKind.CONTROLLER))
        for choice in (self._planner, self._controller):
            choice.on_update(self._take_choice)
        self._share = gui.add_slider(
            "stick, % of limits", 10, 100, 10, round(100 * stick.share), hint="How fast the stick drives at its end"
        )
        self._share.on_update(self._take_share)
        gui.add_button("End the run", hint="Stop, write the results and close this page").on_click(
            lambda _: controls.post(lambda: controls.end("ended in the live view"))
        )

    def show(self) -> None:
        """Label the button with its effect."""
        label = "Resume" if self._controls.holding else "Pause"
        if self._hold.label != label:
            self._hold.label = label

    def _take_click(self, event: Any) -> None:
        self._controls.post(lambda: self._controls.place((event.ray_origin, event.ray_direction)))

    def _take_placing(self, event: Any) -> None:
        self._controls.placing = Placing(self._placing.value)

    def _take_hold(self, event: Any) -> None:
        self._controls.post(lambda: self._controls.hold(not self._controls.holding))

    def _take_share(self, event: Any) -> None:
        self._stick.share = 0.01 * self._share.value

    def _take_choice(self, event: Any) -> None:
        planner, controller = self._planner.value, self._controller.value
        self._controls.post(lambda: self._controls.choose(planner, controller))


class FaultPanel:
    """A fault that begins at once and lasts a while."""

    def __init__(self, server_page: Any, controls: LiveControls, session: Session) -> None:
        gui = server_page.gui
        self._controls = controls
        self._simulation = session.simulation
        sensors = session.faults.sensors
        self._sensor = gui.add_dropdown("of", sensors)
        self._kind = gui.add_dropdown("fault", (*SENSOR_FAULTS, JUMP))
        self._seconds = gui.add_number("for [s]", 5.0, min=0.1, step=0.1)
        self._jump = gui.add_vector3("by x, y [m], yaw [°]", (0.5, 0.0, 0.0), step=0.1, visible=False)
        self._kind.on_update(self._show_fields)
        gui.add_button("Inject", color="orange").on_click(self._inject)

    def _show_fields(self, event: Any) -> None:
        jumps = self._kind.value == JUMP
        self._jump.visible, self._sensor.visible = jumps, not jumps

    def _inject(self, event: Any) -> None:
        kind, sensor, seconds = self._kind.value, self._sensor.value, self._seconds.value
        dx, dy, yaw = self._jump.value

        def inject() -> None:
            start = self._simulation.time
            span = {"start": start, "end": start + seconds}
            fault: SensorFault | LocalizationJump
            if kind == JUMP:
                fault = LocalizationJump(type="jump", dx=dx, dy=dy, dyaw=math.radians(yaw), **span)
            else:
                fault = SensorFault(type=kind, sensor=sensor, **span)
            self._controls.inject(fault)

        self._controls.post(inject)
