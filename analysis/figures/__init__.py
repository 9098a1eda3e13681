"""The figures of the reports: plain arrays in, a matplotlib ``Figure`` out, no global state."""

from steerlab.analysis.figures.embed import svg_data_uri, svg_text
from steerlab.analysis.figures.embeddings import embedding_figure, style_directions
from steerlab.analysis.figures.labels import label_figure
from steerlab.analysis.figures.ladder import improvement_figure, method_name
from steerlab.analysis.figures.people import people_figure
from steerlab.analysis.figures.world import world_figure

__all__ = [
    "embedding_figure",
    "improvement_figure",
    "label_figure",
    "method_name",
    "people_figure",
    "style_directions",
    "svg_data_uri",
    "svg_text",
    "world_figure",
]
