"""What the report pages share: the template environment, pictures, and marked numbers."""

from collections.abc import Callable, Mapping
from dataclasses import fields
from functools import cache
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup
from matplotlib.figure import Figure

from steerlab.analysis.figures import method_name, svg_data_uri
from steerlab.analysis.wording import count, decimal, percent, percent_range, teachers

CSS_PX_PER_IN = 96


def render_page(template: str, *, values: Mapping[str, Any], figures: Any, **names: Any) -> str:
    """A page that needs no other file and no network; equal arguments give equal text.

    Args:
        template: a file of ``analysis/templates``.
        values: the summary as plain values; ``show`` in the template marks numbers with their key.
        figures: a dataclass of matplotlib figures, which become ``images`` by field.
        names: whatever else the template needs.
    """
    return (
        _environment()
        .get_template(template)
        .render(
            images={field.name: _image(getattr(figures, field.name)) for field in fields(figures)},
            show=_shower(values),
            method_name=method_name,
            count=count,
            decimal=decimal,
            percent=percent,
            percent_range=percent_range,
            teachers=teachers,
            **names,
        )
    )


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


def _shower(values: Mapping[str, Any]) -> Callable[..., Markup]:
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
