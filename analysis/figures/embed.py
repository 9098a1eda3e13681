"""Figures as text to put into a page: the same figure gives the same bytes."""

import io
from base64 import b64encode

from matplotlib import rc_context
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine

_LAYOUT_PASSES = 3  # the second sees the ticks of the first; the third moves hardly anything
_NO_METADATA = {"Date": None, "Creator": None}


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
