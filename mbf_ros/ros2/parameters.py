"""The navigation parameters as parameters of the node, and the names and types of its plugins.

What can be changed at run time can be set as any parameter of ROS 2; what is read once is read-only. ``planners``,
``controllers`` and ``recovery_behaviors`` list the loaded plugins, and ``<name>.type`` is the type of each, as the
panel of `rviz_mbf_plugins` expects. Values given with ``--ros-args -p`` take effect over those of the file.
"""

from __future__ import annotations

from typing import Any

from mbf_abstract.config.configuration import PLUGIN_LISTS
from mbf_abstract.config.navigation_parameters import READ_ONCE, NavigationParameters
from mbf_abstract.server.navigation_server import AbstractNavigationServer
from mbf_ros.robot_inputs import ODOM

NOT_VALUES = ("restore_defaults",)
"""Commands among the parameters, which keep no value."""


class NodeParameters:
    """Declares the parameters of a server on a node; raises ValueError where a given value cannot be used.

    Attributes
    ----------
    odom_topic : str
        Topic of odometry; read once, at the start.
    """

    def __init__(self, node: Any, server: AbstractNavigationServer) -> None:
        self._node, self._server = node, server
        self._declare_plugins()
        self.odom_topic: str = self._declare("odom_topic", ODOM, "Topic of odometry.", read_only=True)
        changes = {}
        for name, field in NavigationParameters.model_fields.items():
            if name not in NOT_VALUES:
                value = getattr(server.runtime.parameters, name)
                given = self._declare(name, value, field.description or "", name in READ_ONCE)
                if given != value:
                    changes[name] = given
        if changes:
            server.set_parameters(**changes)
        node.add_on_set_parameters_callback(self._set)

    def _declare(self, name: str, value: Any, description: str, read_only: bool = False) -> Any:
        """Declare one parameter; returns its value, which may be given on the command line."""
        from rcl_interfaces.msg import ParameterDescriptor
        from rclpy.parameter import Parameter

        is_list = isinstance(value, tuple)
        descriptor = ParameterDescriptor(
            description=description, read_only=read_only and not is_list, dynamic_typing=value is None or is_list
        )
        declared = self._node.declare_parameter(name, list(value) if is_list else value, descriptor)
        if is_list and not declared.value:  # rclpy takes an empty list for one of bytes
            self._node.set_parameters([Parameter(name, Parameter.Type.STRING_ARRAY, [])])
        return _ours(declared.value)

    def _declare_plugins(self) -> None:
        for key, kind in PLUGIN_LISTS.items():
            specs = [spec for spec in self._server.config.plugins if spec.kind is kind]
            self._declare(key, tuple(spec.name for spec in specs), "Names of the loaded plugins.")
            for spec in specs:
                self._declare(f"{spec.name}.type", spec.type_name, "Type of this plugin.", read_only=True)

    def _set(self, parameters: list[Any]) -> Any:
        """Put new values into effect, all or none."""
        from rcl_interfaces.msg import SetParametersResult

        names = [one.name for one in parameters]
        if fixed := [name for name in names if name in PLUGIN_LISTS or name == "use_sim_time"]:
            return SetParametersResult(successful=False, reason=f"{fixed[0]} is read once, at the start")
        changes = {one.name: _ours(one.value) for one in parameters if one.name in NavigationParameters.model_fields}
        try:
            if changes:
                self._server.set_parameters(**changes)
        except ValueError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)


def _ours(value: Any) -> Any:
    return tuple(value) if isinstance(value, list) or type(value).__name__ == "array" else value
