"""A documented parameter has an effect: some code reads it. What means the same has one name on every map."""

import ast
import importlib
import pkgutil
from collections import defaultdict
from pathlib import Path

from mbf_abstract.parameters import ParameterModel, PluginParameters

REPOSITORY = Path(__file__).resolve().parents[2]
PACKAGES = ("mbf_abstract", "mbf_costmap_nav", "mbf_mesh_nav", "mbf_ros", "terrain")
READ_BY_NAME = {
    ("NavigationParameters", "restore_defaults"): "taken out of the changes before they are applied",
    ("CriticParameters", None): "one block for each critic, read in the order of the table of critics",
    ("RunRow", None): "the form of a file of results, whose rows are read as mappings",
    ("ResultsFile", None): "the form of a file of results, whose head is read as a mapping",
}


def attributes_read(package):
    """Names of all attributes that the code of a package reads."""
    trees = (ast.parse(file.read_text("utf-8")) for file in (REPOSITORY / package).rglob("*.py"))
    nodes = (node for tree in trees for node in ast.walk(tree))
    return {node.attr for node in nodes if isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Load)}


def parameter_models():
    """Every parameter model of the packages, wherever it is defined."""
    for package in PACKAGES:
        for module in pkgutil.walk_packages(importlib.import_module(package).__path__, package + "."):
            if ".templates." not in module.name:
                importlib.import_module(module.name)
    found = [ParameterModel]
    for model in found:
        found += (derived for derived in model.__subclasses__() if derived not in found)
    return [model for model in found if model.__module__.split(".")[0] in PACKAGES]


def packages_that_may_read(model, name):
    """Those that know the model, or the base that declares the parameter first."""
    first = next(base for base in reversed(model.__mro__) if name in getattr(base, "model_fields", ()))
    homes = {kind.__module__.split(".")[0] for kind in (model, first)}
    return PACKAGES if "mbf_abstract" in {model.__module__.split(".")[0]} else homes


def test_every_parameter_is_read():
    reads = {package: attributes_read(package) for package in PACKAGES}
    models = parameter_models()
    dead = [
        f"{model.__module__}.{model.__name__}.{name}"
        for model in models
        for name in model.__annotations__.keys() & model.model_fields.keys()
        if not any(name in reads[package] for package in packages_that_may_read(model, name))
        and not {(model.__name__, name), (model.__name__, None)} & READ_BY_NAME.keys()
    ]
    assert len(models) > 80
    assert not dead, "read by no code: " + ", ".join(sorted(dead))


def test_parameters_of_plugins_that_are_described_alike_have_one_name():
    names = defaultdict(set)
    for model in (model for model in parameter_models() if issubclass(model, PluginParameters)):
        for name, field in model.model_fields.items():
            names[field.description].add(name)
    twice = [f"{' / '.join(sorted(found))}: {text}" for text, found in names.items() if text and len(found) > 1]
    assert len(names) > 200
    assert not twice, "one meaning, several names: " + "; ".join(sorted(twice))
