"""The layers of one map by name, in their order."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Generic, TypeVar

from mbf_abstract.event_values import error_text
from mbf_abstract.maps.layers.layer import MapLayer
from mbf_abstract.maps.layers.layer_list import LayerListError
from mbf_abstract.maps.layers.source_watch import first_reason

Layer_co = TypeVar("Layer_co", bound=MapLayer, covariant=True)


class LayerStack(Mapping[str, Layer_co], Generic[Layer_co]):
    """Layers by name, ``stack["inflation"]``, in the order in which they are computed.

    Attributes
    ----------
    problem : str
        Which layer raised what since the map was last computed as a whole; empty if none did.

    Raises
    ------
    LayerListError
        Two layers share a name.
    """

    def __init__(self, layers: Sequence[Layer_co] = ()) -> None:
        names = [layer.name for layer in layers]
        if len(set(names)) != len(names):
            raise LayerListError(f"the layers of a map need different names, got {names}")
        self._layers = {layer.name: layer for layer in layers}
        self.problem = ""

    def __getitem__(self, name: str) -> Layer_co:
        if name not in self._layers:
            raise KeyError(f"the map has no layer {name!r}, only {list(self._layers)}")
        return self._layers[name]

    def __contains__(self, name: object) -> bool:
        return name in self._layers

    def __iter__(self) -> Iterator[str]:
        return iter(self._layers)

    def __len__(self) -> int:
        return len(self._layers)

    @property
    def enabled(self) -> Iterator[Layer_co]:
        """The layers that take part."""
        return (layer for layer in self._layers.values() if layer.parameters.enabled)

    def chosen(self, names: Iterable[str] | None) -> list[Layer_co]:
        """All layers, or those of some names; KeyError names the known ones."""
        return list(self.values()) if names is None else [self[name] for name in names]

    def forgetting(self, names: Iterable[str] | None) -> list[Layer_co]:
        """The layers of ``chosen``, without those that clearing leaves as they are."""
        return [layer for layer in self.chosen(names) if layer.forgets]

    @contextmanager
    def computing(self, layer: MapLayer) -> Iterator[None]:
        """Keep as ``problem`` what a layer raises in the ``with`` block, also a ``sys.exit()``, and raise it on."""
        try:
            yield
        except BaseException as error:
            self.note(layer, error)
            raise

    def note(self, layer: MapLayer, error: BaseException) -> None:
        """Keep as ``problem`` what a layer raised."""
        raised = f"layer {layer.name!r} raised {type(error).__name__}: {error_text(error)}"
        self.problem = str(error) if isinstance(error, LayerListError) else raised  # which names the layer itself

    def stale_reason(self, now: float) -> str:
        """Which layer raised, or why the first stale layer is so at ``now`` [s]; empty if all are fresh."""
        if self.problem:
            return self.problem
        reasons = ((layer.name, layer.stale_reason(now)) for layer in self.enabled)
        return first_reason(f"layer {name!r}: {reason}" for name, reason in reasons if reason)

    def configuration_warnings(self) -> list[str]:
        """Legal but suspicious parameters of the layers, a text each."""
        return [f"layer {layer.name!r}: {text}" for layer in self.enabled if (text := layer.configuration_warning())]
