"""The plugin contract as checks that any plugin author can call from their own tests.

>>> def test_my_planner_keeps_the_contract():
...     on_my_map = lambda base: MapContext(**vars(base), navigation_map=my_map)
...     check_planner(MyPlanner, [(start, goal)], make_context=on_my_map)

Each check runs the plugin through many situations and raises one ``ContractBroken`` with everything it found: results
that are not legal, runs that differ although the seed is the same, a cancel that is ignored, inputs that were changed,
exceptions where a result is asked for. It does not judge how good a path or how smooth a drive is.
"""

from mbf_abstract.testing.contract.controller import check_controller
from mbf_abstract.testing.contract.layer import check_layer
from mbf_abstract.testing.contract.planner import check_planner
from mbf_abstract.testing.contract.recovery import check_recovery
from mbf_abstract.testing.contract.refiner import check_refiner
from mbf_abstract.testing.contract.report import ContractBroken

__all__ = ["ContractBroken", "check_controller", "check_layer", "check_planner", "check_recovery", "check_refiner"]
