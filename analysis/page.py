"""What every report page is rendered by: a template, the summary's values, and figures as SVG."""

import io
from base64 import b64encode
from collections.abc import Callable, Mapping
from functools import cache
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup
from matplotlib import rc_context
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine

from steerlab.analysis.wording import count, decimal, method_name, percent, percent_range, teachers

CSS_PX_PER_IN = 96
_LAYOUT_PASSES = 3  # the second sees the ticks of the first; the third moves hardly anything
_NO_METADATA = {"Date": None, "Creator": None}


def render_page(
    template: str, *, values: Mapping[str, Any], figures: Mapping[str, Figure], **names: Any
) -> str:
    """A page that needs no other file and no network; equal arguments give equal text.

    Args:
        template: a file of ``analysis/templates``.
        values: the summary as plain values; ``show`` in the template marks numbers with their key.
        figures: by name; they become ``images`` of the template.
        names: whatever else the template needs.
    """
    return (
        _environment()
        .get_template(template)
        .render(
            images={name: _image(figure) for name, figure in figures.items()},
            show=_show_function(values),
            method_name=method_name,
            count=count,
            decimal=decimal,
            percent=percent,
            percent_range=percent_range,
            teachers=teachers,
            **names,
        )
    )


def svg_text(figure: Figure) -> str:
    """The figure as an SVG document without dates, versions or outside fonts.

    The figure's layout is settled by this and stays: constrained layout starts from where the last
    drawing left it, so each drawing would differ by a little.
    """
    if isinstance(figure.get_layout_engine(), ConstrainedLayoutEngine):
        for _ in range(_LAYOUT_PASSES):
            figure.draw_without_rendering()
        figure.set_layout_engine("none")
    sink = io.StringIO()
    # Ids made from the content instead of at random, and letters as shapes: no font is needed.
    with rc_context({"svg.hashsalt": "steerlab", "svg.fonttype": "path"}):
        figure.savefig(sink, format="svg", metadata=_NO_METADATA)
    return sink.getvalue()


def svg_data_uri(figure: Figure) -> str:
    """The figure as the ``src`` of an image.

    Not inlined as ``<svg>``: the ids of two figures in one page would meet.
    """
    return f"data:image/svg+xml;base64,{b64encode(svg_text(figure).encode()).decode()}"


@cache
def _environment() -> Environment:
    return Environment(
        loader=PackageLoader("steerlab.analysis", "templates"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )


def _image(figure: Figure) -> dict[str, Any]:
    width_in, height_in = figure.get_size_inches()
    return {
        "src": svg_data_uri(figure),
        "width": round(width_in * CSS_PX_PER_IN),
        "height": round(height_in * CSS_PX_PER_IN),
    }


def _show_function(values: Mapping[str, Any]) -> Callable[..., Markup]:
    """``show('splits.new.people', 'count')``: a number of the summary, marked with its key.

    The mark (``<data data-key value>``) ties each number in the page to the summary's.
    """
    forms: dict[str, Callable[[Any], str]] = {
        "percent": percent,
        "percent_range": percent_range,
        "decimal": decimal,
        "count": count,
        "points": lambda value: percent(value / 100.0),  # a value that is in percent already
    }

    def show(key: str, form: str) -> Markup:
        value: Any = values
        for part in key.split("."):
            value = value[part]
        if value is None:
            return Markup('<span title="too few people to measure">not measured</span>')
        plain = " ".join(map(str, value)) if isinstance(value, list) else str(value)
        shown = forms[form](value)
        return Markup('<data data-key="{}" value="{}">{}</data>').format(key, plain, shown)

    return show
