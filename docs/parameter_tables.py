"""The configuration reference: a table for every parameter model of the core, the servers, the plugins and layers."""

from __future__ import annotations

import inspect
import math
from typing import Any, get_args

from annotated_types import Ge, Gt, Le, Lt
from pydantic.fields import FieldInfo

from mbf_abstract.commands.starters import listing
from mbf_abstract.config.configuration import PluginDeclaration
from mbf_abstract.config.navigation_parameters import NavigationParameters
from mbf_abstract.config.registry import PluginRegistry
from mbf_abstract.parameters import ParameterModel
from mbf_abstract.server.navigation_server import AbstractNavigationServer

MARK = "<!-- Written by docs/generate_reference.py from the parameter models; do not edit. -->"
INTRODUCTION = f"""\
# Configuration

{MARK}

A robot has one configuration, a YAML file. Start from one that passes `mbf check`:

```sh
mbf config             # the list below; with a name it writes one, for your map:
mbf config costmap_differential --map office.yaml --out robot.yaml
mbf check robot.yaml   # every mistake at once, with its line
```

{{starters}}
`backend` chooses the server, and with it the map. Navigation parameters stand at the top level. The lists `planners`,
`controllers`, `recovery_behaviors` and `refiners` name plugins; the parameters of a plugin stand in a block of its
name. The map has a section of its own, with a list of layers and a block for each layer.

| page | what is on it |
|---|---|
| this page | parameters of navigation, and plugins that run on every map |
| [Costmap server](configuration_costmap.md) | `backend: costmap`: its maps, layers and plugins |
| [Mesh and tiles servers](configuration_mesh.md) | `backend: mesh`, `backend: tiles`: their maps, layers and plugins |

In the tables, a default of **required** must be given. Of a range, `[` includes the bound and `(` does not. *While
running* says whether a change takes effect on goals that run already; otherwise it is read when a goal starts or when
the server is made.

While the server runs, its methods change values. A call changes all of its values or, where one is wrong, none:

- `server.set_parameters(...)` and `set_plugin_parameters(kind, name, ...)`;
- `set_map_parameters("local_costmap", max_age=1.0)`;
- `set_layer_parameters("global_costmap.inflation", inflation_radius=0.8)`;
- `set_footprint(...)` with corners, or a radius; a mesh takes a radius, and those of its layers change by as much;
  its `check_footprint` is off then.

A map shows a change after its next update.
"""

BACKENDS = {
    "costmap": ("Configuration of the costmap server", "costmap_layers", ("costmap",)),
    "mesh": ("Configuration of the mesh and tiles servers", "mesh_layers", ("mesh", "tiles")),
}
"""Page -> its title, the group of its layers, and the servers on it."""
KINDS = {
    "planners": "Planners",
    "controllers": "Controllers",
    "recoveries": "Recovery behaviours",
    "refiners": "Refiners",
}


def configuration_pages() -> dict[str, str]:
    """Return the names and texts of the pages: one for what all maps have, one for each kind of map."""
    registry = PluginRegistry()
    ours = [entry for entry in registry.entries() if _is_ours(entry.target)]

    def plugins(prefixes: tuple[str, ...], groups: dict[str, str]) -> list[str]:
        """Headings and tables of the plugins whose names have one of the prefixes."""
        parts = []
        for group, title in groups.items():
            chosen = [one for one in ours if one.group == group and one.name.rpartition(".")[0] in prefixes]
            if chosen:
                parts.append(f"## {title}\n")
                parts += [_plugin(one.name, registry.load(group, one.name)) for one in chosen]
        return parts

    first = INTRODUCTION.replace("{starters}", starters_table())
    pages = {"configuration.md": [first, "## Navigation\n", *_core(), *plugins(("",), KINDS)]}
    for page, (title, layers, servers) in BACKENDS.items():
        parts = [f"# {title}\n\n{MARK}\n\nNavigation parameters, and plugins that run on every map, are on [the first "]
        parts[0] += "page](configuration.md), which also says how to read the tables.\n"
        for name in servers:
            parts += _server(registry.load("servers", name, AbstractNavigationServer))
        parts += plugins(servers, {layers: "Layers", **KINDS})
        pages[f"configuration_{page}.md"] = parts
    return {name: "\n".join(parts) for name, parts in pages.items()}


def starters_table() -> str:
    """Return a table of the configurations to start from."""
    lines = [line.partition(" ") for line in listing().splitlines()]
    return "| starter | for |\n|---|---|\n" + "".join(f"| `{name}` | {text.strip()} |\n" for name, _, text in lines)


def _is_ours(target: str) -> bool:
    return target.startswith(("mbf_abstract.", "mbf_costmap_nav.", "mbf_mesh_nav."))


TOP_LEVEL = """\
| name | default | meaning |
|---|---|---|
| `backend` | **required** | The server: a registered name or module:Class. |
| `allow_module_types` | true | Whether types may be module:Class. |
| `planners`, `controllers`, `recovery_behaviors`, `refiners` | [] | Plugins in order; the first is the default. |
"""


def _core() -> list[str]:
    items = f"### Items of the plugin lists\n\n{parameter_table(PluginDeclaration)}"
    return [TOP_LEVEL, parameter_table(NavigationParameters), items]


def _server(server: type[AbstractNavigationServer]) -> list[str]:
    """Sections of one server; sections of one model share a table."""
    parts = [f"## Map of the {server.backend} server\n"]
    models: dict[type[ParameterModel], list[str]] = {}
    for key, model in server.config_sections.items():
        models.setdefault(model, []).append(f"`{key}`")
    parts += [f"### {' and '.join(keys)}\n\n{parameter_table(model)}" for model, keys in models.items()]
    own = [name for name in server.plugin_declaration.model_fields if name not in PluginDeclaration.model_fields]
    if own:
        parts.append(f"### Further keys of its plugin lists\n\n{parameter_table(server.plugin_declaration, own)}")
    return parts


def _plugin(name: str, plugin_class: Any) -> str:
    """Heading, the first paragraph of the module's text, and the table."""
    module = inspect.getdoc(inspect.getmodule(plugin_class)) or ""
    summary = " ".join(module.partition("\n\n")[0].split())
    return f"### `{name}`\n\n{summary}\n\n{parameter_table(plugin_class.Parameters)}"


def parameter_table(model: type[ParameterModel], names: list[str] | None = None, dynamic: bool | None = True) -> str:
    """Return the Markdown table of a model's parameters, or of some of them; none is dynamic inside one that is not.

    With ``dynamic`` None nothing of the model is read while running: the table has no column for it, and none of the
    tables of the models inside.
    """
    fields = {name: field for name, field in model.model_fields.items() if names is None or name in names}
    if not fields:
        return "No parameters.\n"
    headings = ["name", "default", "unit", "range", "while running", "meaning"]
    if dynamic is None:
        headings.remove("while running")
    rows = ["| " + " | ".join(headings) + " |", "|" + "---|" * len(headings)]
    for name, field in fields.items():
        extra: Any = field.json_schema_extra or {}
        changes = [] if dynamic is None else ["yes" if dynamic and extra.get("dynamic", True) else "no"]
        cells = (f"`{name}`", _default(field), extra.get("unit", ""), _range(field), *changes, field.description or "")
        rows.append("| " + " | ".join(str(cell).replace("|", "\\|") for cell in cells) + " |")
    table = "\n".join(rows) + "\n"
    if dynamic is None:
        return table
    for name, field in fields.items():
        for inner in models_in(field.annotation):
            summary = (inspect.getdoc(inner) or "").partition("\n\n")[0]
            extra = field.json_schema_extra or {}
            keys = parameter_table(inner, dynamic=dynamic and extra.get("dynamic", True))
            table += f"\nKeys of `{name}`: {summary}\n\n{keys}"
    return table


def models_in(annotation: Any) -> list[type[ParameterModel]]:
    """Parameter models inside a type such as ``tuple[Zone, ...]`` or ``dict[str, Source]``."""
    if isinstance(annotation, type) and issubclass(annotation, ParameterModel):
        return [annotation]
    return [model for part in get_args(annotation) for model in models_in(part)]


def _default(field: FieldInfo) -> str:
    if field.is_required():
        return "**required**"
    value = field.get_default(call_default_factory=True)
    if value is None or value == "":
        return "none" if value is None else '""'
    if isinstance(value, ParameterModel):
        return "see below"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float):
        return f"{'-' if value < 0.0 else ''}.inf" if math.isinf(value) else f"{value:.6g}"
    if isinstance(value, tuple | list | dict):
        return "{}" if isinstance(value, dict) and not value else str(list(value))
    return str(getattr(value, "value", value))


def _range(field: FieldInfo) -> str:
    """Interval of the legal values; empty if there is none."""
    low = high = ""
    for limit in field.metadata:
        if isinstance(limit, Ge | Gt):
            low = f"[{limit.ge:.6g}" if isinstance(limit, Ge) else f"({limit.gt:.6g}"
        elif isinstance(limit, Le | Lt):
            high = f"{limit.le:.6g}]" if isinstance(limit, Le) else f"{limit.lt:.6g})"
    choices = getattr(field.annotation, "__args__", ())
    if choices and all(isinstance(choice, str) for choice in choices):
        return ", ".join(f"`{choice}`" if choice else '`""`' for choice in choices)
    if not low and not high:
        return ""
    return f"{low or '(-inf'}, {high or 'inf)'}"
