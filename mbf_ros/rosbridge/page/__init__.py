"""The page that the server serves: map, robot, plan; a tap or click is a goal. Plain files, without a build step."""

from __future__ import annotations

from importlib.resources import files

TYPES = {"html": "text/html; charset=utf-8", "js": "text/javascript; charset=utf-8", "css": "text/css; charset=utf-8"}


def page_files() -> dict[str, tuple[str, bytes]]:
    """Content type and content by the paths of the page."""
    found = {
        f"/{name}": (TYPES[name.rpartition(".")[2]], files(__package__).joinpath(name).read_bytes())
        for name in ("index.html", "page.js", "input.js", "page.css")
    }
    return {**found, "/": found["/index.html"]}
