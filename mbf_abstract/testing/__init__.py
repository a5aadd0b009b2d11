"""For tests of plugins and executives: scripted and failing plugins, a loopback robot, a bench, the plugin contract.

Nothing here is meant for a real robot. Start with ``bench.Bench`` to run goals, and with ``check_planner`` and its
siblings in ``contract`` to test a plugin of your own.
"""
