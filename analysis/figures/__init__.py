"""The figures of the reports: plain arrays in, a matplotlib ``Figure`` out, no global state."""

from steerlab.analysis.figures.embeddings import embedding_figure, style_directions
from steerlab.analysis.figures.labels import improvement_figure, label_figure, people_figure
from steerlab.analysis.figures.world import world_figure

__all__ = [
    "embedding_figure",
    "improvement_figure",
    "label_figure",
    "people_figure",
    "style_directions",
    "world_figure",
]
