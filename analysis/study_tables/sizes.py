"""From how many people on an estimate is shown. Tests are not held back by these: they are exact.

Below a size the number is still in ``tables.json`` and the CSV files, marked ``too_few``; the page
says how many there are and how many it takes.
"""

CORRELATIONS = 20
"""People for a table of correlations. A correlation is within .1 of its true value, and stays there,
from some 250 people on; the study that found this does not look below 20 (Schönbrodt & Perugini,
Journal of Research in Personality 47, 609-612, 2013). Four dimensions of w have R = .46 with nothing
at all by chance, on average, with 20 people."""

ALPHA = 30
"""People for Cronbach's alpha: enough if items go together well, the fewest that studies of its sample
size name (Yurdugül, Hacettepe University Journal of Education 35, 397-405, 2008, as summed up by
Bujang, Omar & Baharum, Malaysian Journal of Medical Sciences 25(6), 85-99, 2018). Feldt's interval of
an alpha of .8 over four items then goes from .65 to .90; with ten people from .47 to .94."""

BANDS = 10
"""People for a percentile bootstrap over them. It is too narrow for few people (Hesterberg, The
American Statistician 69, 371-386, 2015): of a normal mean by 37 % with five, 18 % with ten, 9 % with
twenty, next to the t interval."""


def mark(people: int, fewest: int) -> str | None:
    """The mark of a number that is computed from too few people to be shown; else None."""
    if people >= fewest:
        return None
    return f"{people} people; shown from {fewest}"
