"""From the ``layers`` list of a configuration to classes and checked parameters, in the order of computation.

Every map has an ordered list of layers and a block of parameters for each, as MBF writes its plugin lists::

    layers:
      - {name: walls, type: static}
      - {name: inflation, type: inflation}
    inflation: {inflation_radius: 0.6}

All findings are reported at once, before a map file is read.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from graphlib import CycleError, TopologicalSorter
from typing import Any, Generic, TypeVar, cast

from pydantic import ValidationError

from mbf_abstract.config.registry import PluginError, PluginRegistry
from mbf_abstract.event_values import error_text
from mbf_abstract.maps.layers.layer import LayerParameters, MapLayer
from mbf_abstract.parameters import ParameterModel, parameter

Layer = TypeVar("Layer", bound=MapLayer)
Made = TypeVar("Made")
LayerBlocks = Mapping[str, Mapping[str, Any] | LayerParameters]
"""Layer name -> its block, raw or validated; a layer without one gets its defaults."""


class LayerListError(ValueError):
    """The layers of a map cannot be built; the text has all findings: unknown types or inputs, circles and so on."""


@contextmanager
def making(name: str, passing: tuple[type[Exception], ...] = ()) -> Iterator[None]:
    """Let what a layer raises while its map is built, also a ``sys.exit()``, end as a LayerListError with its name.

    Errors that are ``passing`` stay as they are: those of files, which name them.
    """
    known: tuple[type[Exception], ...] = (LayerListError, *passing)
    try:
        yield
    except known:
        raise
    except (Exception, SystemExit) as error:
        raise LayerListError(f"layer {name!r} raised {type(error).__name__}: {error_text(error)}") from error


def made_layer(name: str, make: Callable[[], Made], passing: tuple[type[Exception], ...] = ()) -> Made:
    """Make a layer; LayerListError with its name as ``making``, also where it does not call its base's constructor."""
    with making(name, passing):
        layer = make()
        if getattr(layer, "name", None) != name or not hasattr(layer, "parameters"):
            raise TypeError("its __init__ does not call super().__init__(context)")
        return layer


class LayerEntry(ParameterModel):
    """One line of the ``layers`` list."""

    name: str = parameter(..., "Name of the layer; its parameters stand in the block of that name.")
    type: str = parameter(..., "Type of the layer, or module:Class.")

    @property
    def reads(self) -> tuple[str, ...]:
        """Names of the layers whose values it needs, beside the order of the list."""
        return ()


@dataclass(frozen=True)
class PlannedLayer(Generic[Layer]):
    """A layer that is ready to be constructed."""

    entry: LayerEntry
    layer_class: type[Layer]
    parameters: LayerParameters


def layer_loader(backend: str, base: type) -> Callable[[str], Any]:
    """Return a function from the type of a layer of this backend to its class; it raises PluginError.

    Parameters
    ----------
    base : type
        Interface of the layers of the map.
    """
    registry = PluginRegistry(backend)
    return lambda type_name: registry.load(f"{backend}_layers", type_name, base)


def plan_layers(
    entries: Sequence[LayerEntry],
    blocks: LayerBlocks,
    load: Callable[[str], type[Layer]],
    check: Callable[[PlannedLayer[Layer]], Iterable[str]] = lambda planned: (),
) -> list[PlannedLayer[Layer]]:
    """Load and check the layers of a list and order them, inputs first.

    Parameters
    ----------
    blocks : mapping
        See ``LayerBlocks``.
    load : callable
        Type -> class, see ``layer_loader``.
    check : callable
        Further findings of a map about one layer.

    Raises
    ------
    LayerListError
        With all findings.
    """
    names = [entry.name for entry in entries]
    findings = [
        f"layer name {name!r} is used twice" for name in sorted({name for name in names if names.count(name) > 1})
    ]
    findings += [f"there are parameters for {name!r}, but no such layer" for name in blocks if name not in names]
    planned: dict[str, PlannedLayer[Layer]] = {}
    for entry in entries:
        try:
            layer_class = load(entry.type)
            planned[entry.name] = PlannedLayer(entry, layer_class, _validated(layer_class, blocks.get(entry.name, {})))
            findings += check(planned[entry.name])
        except ValidationError as error:
            findings += [f"layer {entry.name!r}: {_place(item['loc'])}{item['msg']}" for item in error.errors()]
        except PluginError as error:
            findings.append(f"layer {entry.name!r}: {error}")
    order: Sequence[str] = ()
    try:
        order = dependency_order({entry.name: entry.reads for entry in entries})
    except LayerListError as error:
        findings.append(str(error))
    if findings:
        raise LayerListError("; ".join(findings))
    return [planned[name] for name in order]


def _validated(layer_class: type[MapLayer], block: Mapping[str, Any] | LayerParameters) -> LayerParameters:
    if isinstance(block, layer_class.Parameters):
        return block
    return layer_class.Parameters.model_validate(dict(cast(Mapping[str, Any], block)))


def _place(location: tuple[int | str, ...]) -> str:
    return ".".join(str(part) for part in location) + ": " if location else ""


def dependency_order(inputs: Mapping[str, Sequence[str]]) -> list[str]:
    """Order layer names so that inputs come first, keeping the configured order where it is free.

    Parameters
    ----------
    inputs : mapping
        For every layer the names of the layers it reads.

    Raises
    ------
    LayerListError
        An input is not the name of a layer, or layers wait for each other; every finding is named.
    """
    findings = [
        f"{name} reads unknown layer '{read}'" for name in inputs for read in inputs[name] if read not in inputs
    ]
    if findings:
        findings.append(f"the layers are: {', '.join(inputs)}")
    known = {name: [read for read in reads if read in inputs] for name, reads in inputs.items()}
    sorter, order = TopologicalSorter(known), list[str]()
    try:
        sorter.prepare()
    except CycleError as error:
        findings.append(f"layers read each other in a cycle: {' -> '.join(_from_first(error.args[1], list(inputs)))}")
    if findings:
        raise LayerListError("; ".join(findings))
    configured = list(inputs).index
    while sorter.is_active():
        ready = sorted(sorter.get_ready(), key=configured)
        order += ready
        sorter.done(*ready)
    return order


def _from_first(circle: Sequence[str], configured: Sequence[str]) -> list[str]:
    """Turn a circle of graphlib, which ends as it begins, so that each name reads the next, the first one first."""
    names = list(reversed(circle))[1:]
    start = min(range(len(names)), key=lambda place: configured.index(names[place]))
    return [*names[start:], *names[:start], names[start]]
