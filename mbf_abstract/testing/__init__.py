"""For tests of plugins, executives and map backends: scripted plugins, a loopback robot, sessions, the contracts.

Nothing here is meant for a real robot. Start with ``scripted_session.ScriptedSession`` to run goals, with
``check_planner`` and its siblings in ``contract`` to test a plugin of your own, and with ``check_map_backend`` to test
a map backend of your own.
"""

from mbf_abstract.testing.conformance import check_map_backend

__all__ = ["check_map_backend"]
