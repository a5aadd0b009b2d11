"""The contract of map backends: the same situations asked of any of them, with the same outcomes and texts expected.

>>> def make_server(rig, **parameters):
...     np.save(rig.folder / "flat.npy", np.zeros((81, 121)))
...     return rig.server(CONFIG, parameters)
>>> def test_my_backend_keeps_the_contract():
...     check_map_backend(make_server)

``CONFIG`` is the text of a configuration: 12 m x 8 m of flat, empty, known ground, a robot of 0.3 m radius, scans of
the source ``lidar``, a planner, a controller, and the recoveries under the names of their types. The suite uses the
server's public interface only. ``SITUATIONS`` are its parts by name, for one test each.
"""

from __future__ import annotations

from collections.abc import Iterable
from types import ModuleType

from mbf_abstract.testing.conformance import (
    asking,
    bad_plugins,
    canceling,
    changing,
    driving,
    freshness,
    planning,
    recovering,
    refining,
    sensing,
    touching,
    unreachable_paths,
)
from mbf_abstract.testing.conformance.rig import BackendRig, MakeServer
from mbf_abstract.testing.conformance.site import Situation
from mbf_abstract.testing.contract.report import ContractBroken

__all__ = ["SITUATIONS", "BackendRig", "ContractBroken", "MakeServer", "Situation", "check_map_backend"]

_PARTS: tuple[ModuleType, ...] = (
    planning,
    driving,
    unreachable_paths,
    bad_plugins,
    touching,
    canceling,
    sensing,
    freshness,
    asking,
    recovering,
    refining,
    changing,
)

SITUATIONS: dict[str, Situation] = {
    name: part for module in _PARTS for name, part in vars(module).items() if isinstance(part, Situation)
}
"""All situations by name."""


def check_map_backend(make_server: MakeServer, situations: Iterable[str] = tuple(SITUATIONS)) -> None:
    """Put a backend through the situations.

    Parameters
    ----------
    make_server : callable
        See ``MakeServer``; called once for each situation.
    situations : iterable of str
        Names of the situations; all if not given.

    Raises
    ------
    ContractBroken
        With everything that is wrong.
    KeyError
        There is no such situation.
    """
    broken: list[str] = []
    for name in situations:
        try:
            SITUATIONS[name].run(make_server)
        except ContractBroken as error:
            broken.append(str(error))
    if broken:
        raise ContractBroken("\n".join(broken))
