"""The parts every page of a run is made of: the frame with its style, and tables. No script, nothing from a network."""

from __future__ import annotations

import base64
import io
import math
from collections.abc import Iterable
from html import escape
from typing import Any

from terrain.viewer.pictures.colours import LEVELS
from terrain.viewer.reports.metric_names import in_words

WEBP_QUALITY = 90  # of 100; a picture of rough ground has a seventh of its PNG's bytes, and no reader sees a difference
MAX_ROWS = 200
WHOLE_FROM = 1000.0  # numbers that are written without decimals
FOLDED_FROM = 60  # rows; the metrics of a run are fewer

STYLE = """
body { font: 15px/1.45 system-ui, sans-serif; color: #222; margin: 2em auto; padding: 0 1em;
  overflow-wrap: anywhere; }
h1 { font-size: 1.5em; margin-bottom: 0; } h2 { font-size: 1.15em; margin-top: 2em; }
.outcome { font-size: 1.15em; font-weight: 600; }
table { border-collapse: collapse; } td, th { text-align: left; padding: 2px 14px 2px 0; vertical-align: top; }
th { color: #555; font-weight: 600; border-bottom: 1px solid #ccc; } td:first-child { white-space: nowrap; }
.wide { overflow-x: auto; }
img { max-width: 100%; height: auto; } svg { width: 100%; height: auto; } summary { color: #555; cursor: pointer; }
.beside { display: grid; grid-auto-flow: column; grid-auto-columns: 1fr; gap: 0 2em; align-items: start; }
.beside > * { min-width: 0; }
@media (max-width: 600px) {
  .beside { grid-auto-flow: row; grid-auto-columns: auto; }
  td:first-child { white-space: normal; } td, th { min-width: 5em; }
}
"""
STYLE += "".join(f".{level.value} {{ color: {colour}; }}\n" for level, colour in LEVELS.items())


def page(title: str, parts: Iterable[str], width: int = 1000) -> str:
    """A whole page with the parts, at most ``width`` pixels wide."""
    head = '<meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">'
    head += f"<title>{escape(title)}</title><style>{STYLE}body {{ max-width: {width}px }}</style>"
    return "\n".join(["<!doctype html>", f'<html lang="en"><head>{head}</head><body>', *parts, "</body></html>"])


def image(what: str, png: bytes) -> str:
    """A picture, given as a PNG file, ``what`` says what is in it; the page has it as WebP, if Pillow can."""
    from PIL import Image, features

    kind, data = "png", png
    if features.check("webp"):
        buffer = io.BytesIO()
        Image.open(io.BytesIO(png)).convert("RGB").save(buffer, "WEBP", quality=WEBP_QUALITY, method=2)
        kind, data = "webp", buffer.getvalue()
    text = base64.b64encode(data).decode("ascii")
    return f'<img alt="{escape(what)}" src="data:image/{kind};base64,{text}">'


def beside(*parts: str) -> str:
    """Parts in columns of the same width."""
    return f'<div class="beside">{"".join(f"<div>{part}</div>" for part in parts)}</div>'


def table(header: tuple[str, ...], rows: Iterable[tuple[Any, ...]]) -> str:
    """A table of at most ``MAX_ROWS`` rows, folded if it is long, with a note of rows left out."""
    listed = list(rows)
    if not listed:
        return "<p>none</p>"
    head = "".join(f"<th>{escape(name)}</th>" for name in header)
    body = "".join(
        "<tr>" + "".join(f"<td>{escape(cell(value))}</td>" for value in row) + "</tr>" for row in listed[:MAX_ROWS]
    )
    more = f"<p>and {len(listed) - MAX_ROWS} more, see events.jsonl</p>" if len(listed) > MAX_ROWS else ""
    text = f'<div class="wide"><table><tr>{head}</tr>{body}</table></div>{more}'
    return text if len(listed) <= FOLDED_FROM else f"<details><summary>{len(listed)} rows</summary>{text}</details>"


def cell(value: Any) -> str:
    """A value as short text, those in lists and by names too."""
    if isinstance(value, float) and math.isfinite(value):
        return number(value)
    if value is None or isinstance(value, bool):
        return {None: "-", True: "yes", False: "no"}[value]
    if isinstance(value, dict):
        return ", ".join(_named(name, of) for name, of in value.items()) or "none"
    if isinstance(value, list | tuple):
        return ("; " if any(isinstance(of, dict) for of in value) else ", ").join(map(cell, value)) or "none"
    return str(value)


def number(value: float, sign: str = "") -> str:
    """A number with four digits, never in powers of ten where it is large; ``sign`` is "+" for a difference."""
    return f"{value:{sign}.4g}" if abs(value) < WHOLE_FROM else f"{value:{sign}.0f}"


def _named(name: str, value: Any) -> str:
    words, _, unit = in_words(name).removesuffix("]").partition(" [")
    return f"{words} {cell(value)} {unit}".rstrip()
