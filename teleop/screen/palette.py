"""The colours: Okabe and Ito's, told apart by every kind of colour vision, on a dark ground.

None of them says anything alone: there is a shape or a word with each.
Source: Okabe & Ito (2008), Color Universal Design.
"""

Colour = tuple[int, int, int]

GROUND: Colour = (19, 23, 31)
PANEL: Colour = (19, 23, 31)
PANEL_ALPHA = 205
TRACK: Colour = (62, 70, 84)
EDGE: Colour = (132, 142, 158)
WORDS: Colour = (242, 244, 247)
QUIET: Colour = (176, 184, 196)
ACCENT: Colour = (86, 180, 233)  # sky blue
GOOD: Colour = (0, 178, 130)  # bluish green, lightened for a dark ground
WARNING: Colour = (240, 228, 66)  # yellow
ERROR: Colour = (230, 111, 30)  # vermilion, lightened
GOAL: Colour = (240, 160, 20)  # orange, as the ball is
