"""Pieces of a self-contained HTML page: no scripts, no files beside it, nothing fetched."""

from __future__ import annotations

import base64
import math
from html import escape
from io import BytesIO
from numbers import Real

STYLE = """
:root { color-scheme: light; --ink: #1d2733; --soft: #5b6776; --line: #d9dee5; --mark: #2f6f9f; --paper: #ffffff; }
* { box-sizing: border-box; }
body { margin: 0 auto; max-width: 1080px; padding: 24px 20px 60px; background: #f4f6f8; color: var(--ink);
       font: 15px/1.5 system-ui, -apple-system, "Segoe UI", "DejaVu Sans", sans-serif; }
h1 { font-size: 1.65rem; line-height: 1.25; margin: 0 0 6px; }
h2 { font-size: 1.15rem; margin: 0 0 12px; }
h3 { font-size: 0.95rem; margin: 18px 0 6px; }
p { margin: 6px 0; }
header p { color: var(--soft); }
section { background: var(--paper); border: 1px solid var(--line); border-radius: 8px; padding: 18px 20px;
          margin-top: 18px; }
nav a { color: var(--mark); margin-right: 14px; text-decoration: none; }
nav a:hover { text-decoration: underline; }
.badge { display: inline-block; padding: 1px 10px; border-radius: 10px; font-size: 0.9rem; color: #fff;
         background: #2e7d4f; }
.badge.bad { background: #b3362b; } .badge.open { background: #98700c; }
.tiles { display: grid; grid-template-columns: repeat(auto-fill, minmax(150px, 1fr)); gap: 12px; }
.tile { border: 1px solid var(--line); border-radius: 6px; padding: 10px 12px; }
.tile b { display: block; font-size: 1.2rem; font-weight: 600; line-height: 1.3; }
.tile span { color: var(--soft); font-size: 0.85rem; }
@media (max-width: 480px) { .figures { display: block; } }
.figures { display: grid; grid-template-columns: repeat(auto-fit, minmax(400px, 1fr)); gap: 16px; align-items: start; }
.wide { grid-column: 1 / -1; }
figure { margin: 0; } figure img { width: 100%; height: auto; max-height: 560px; object-fit: contain; }
figcaption { color: var(--soft); font-size: 0.85rem; text-align: center; }
ul { margin: 0; padding-left: 20px; } .warning li { color: #8a3b12; }
.scroll { overflow-x: auto; }
table { border-collapse: collapse; font-size: 0.9rem; min-width: 40%; }
th, td { padding: 4px 12px 4px 0; border-bottom: 1px solid var(--line); text-align: left; vertical-align: top; }
th { color: var(--soft); font-weight: 600; white-space: nowrap; }
td.n, th.n { text-align: right; font-variant-numeric: tabular-nums; white-space: nowrap; }
.bar { height: 9px; background: var(--mark); border-radius: 2px; min-width: 1px; }
table.bars, td.wide { width: 100%; } table.bars th { padding-right: 24px; }
pre { background: #f4f6f8; border-radius: 6px; padding: 12px 14px; overflow-x: auto; font-size: 0.82rem;
      line-height: 1.45; margin: 0; }
@media print { body { background: #fff; max-width: none; } section { break-inside: avoid; border: none; padding: 6px 0; }
               nav { display: none; } }
"""


def page(title: str, parts: list[tuple[str, str]], head: str) -> str:
    """The whole page: parts are (title, HTML) of the sections; those without HTML are left out."""
    parts = [(name, body) for name, body in parts if body]
    links = "".join(f'<a href="#{_anchor(name)}">{escape(name)}</a>' for name, _ in parts)
    body = "".join(f'<section id="{_anchor(name)}"><h2>{escape(name)}</h2>{body}</section>\n' for name, body in parts)
    return (f'<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
            f'<meta name="viewport" content="width=device-width, initial-scale=1">\n<title>{escape(title)}</title>\n'
            f"<style>{STYLE}</style>\n</head>\n<body>\n<header>{head}<nav>{links}</nav></header>\n{body}</body>\n</html>\n")


def _anchor(name: str) -> str:
    return "".join(c if c.isalnum() else "-" for c in name.lower())


def figure(picture: str, caption: str, *, wide: bool = False) -> str:
    """A picture with its caption."""
    css = ' class="wide"' if wide else ""
    return f'<figure{css}><img src="{picture}" alt="{escape(caption)}"><figcaption>{escape(caption)}</figcaption></figure>'


def figures(pieces: list[str]) -> str:
    """Figures side by side, as many as the page is wide."""
    return f'<div class="figures">{"".join(pieces)}</div>' if pieces else ""


def tiles(facts: list[tuple[str, str]]) -> str:
    """(what, value) in boxes."""
    return '<div class="tiles">' + "".join(
        f'<div class="tile"><b>{escape(value)}</b><span>{escape(name)}</span></div>' for name, value in facts) + "</div>"


def bullets(sentences: list[str], css: str = "") -> str:
    """A list of sentences; nothing for none."""
    items = "".join(f"<li>{escape(sentence)}</li>" for sentence in sentences)
    return f'<ul class="{css}">{items}</ul>' if sentences else ""


def table(rows: list[list], head: list[str] = ()) -> str:
    """Rows of texts and numbers; numbers stand to the right."""
    if not rows:
        return ""
    numeric = [isinstance(value, Real) for value in rows[0]]
    top = "".join(f"<th{' class=n' * right}>{escape(name)}</th>" for name, right in zip(head, numeric, strict=False))
    body = "".join("<tr>" + "".join(_cell(value) for value in row) + "</tr>" for row in rows)
    return f'<div class="scroll"><table>{f"<tr>{top}</tr>" if top else ""}{body}</table></div>'


def _cell(value) -> str:
    if isinstance(value, Real):
        return f'<td class="n">{escape(number(value))}</td>'
    return f"<td>{escape(str(value))}</td>"


def bars(shares: dict[str, float], unit: str) -> str:
    """A bar for every share, largest first."""
    whole = max(shares.values(), default=0.0)
    rows = "".join(
        f'<tr><th>{escape(name)}</th><td class="n">{escape(number(value))} {unit}</td>'
        f'<td class="wide"><div class="bar" style="width:{100 * value / whole:.1f}%"></div></td></tr>'
        for name, value in sorted(shares.items(), key=lambda item: -item[1]) if value > 0)
    return f'<div class="scroll"><table class="bars">{rows}</table></div>' if rows else ""


def number(value) -> str:
    """Up to five figures, exponents as 3.2·10⁻⁴, a true minus."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if not math.isfinite(value):
        return "—"
    text = f"{value:.5g}" if float(value).is_integer() else f"{value:.4g}"
    mantissa, _, exponent = text.partition("e")
    if exponent:
        raised = str(int(exponent)).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))
        text = f"{mantissa}·10{raised}"
    return text.replace("-", "\N{MINUS SIGN}")


def picture_of(ax, kind: str = "svg") -> str:
    """The figure of matplotlib axes as a data address; ``kind``: svg for diagrams, png for fields."""
    import matplotlib

    with BytesIO() as buffer, matplotlib.rc_context({"svg.hashsalt": "fenics_forming"}):
        metadata = {"Date": None} if kind == "svg" else {}
        ax.figure.savefig(buffer, format=kind, dpi=110, bbox_inches="tight", pad_inches=0.08, metadata=metadata)
        return address(buffer.getvalue(), {"svg": "image/svg+xml", "png": "image/png"}[kind])


def picture_of_array(array) -> str:
    """A picture (height, width, 3) as a data address."""
    from PIL import Image

    with BytesIO() as buffer:
        Image.fromarray(array).save(buffer, format="png", optimize=True)
        return address(buffer.getvalue(), "image/png")


def address(content: bytes, kind: str) -> str:
    """Bytes as a data address."""
    return f"data:{kind};base64,{base64.b64encode(content).decode()}"
