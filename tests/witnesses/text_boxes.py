"""What a laid out figure says where: the boxes of the texts that are really drawn."""

from dataclasses import dataclass
from itertools import combinations
from unittest import mock

from matplotlib.text import Text

#: Pixels by which boxes may touch: sizes are rounded.
TOUCH = 1.0


@dataclass(frozen=True)
class Box:
    """A text and its box in pixels."""

    text: str
    x0: float
    y0: float
    x1: float
    y1: float

    def covers(self, other):
        """Whether two boxes have a part in common."""
        return (
            min(self.x1, other.x1) - max(self.x0, other.x0) > TOUCH
            and min(self.y1, other.y1) - max(self.y0, other.y0) > TOUCH
        )


def drawn_texts(figure):
    """Return the texts that drawing a figure draws, after it has been laid out."""
    figure.draw_without_rendering()
    seen = []
    draw = Text.draw

    def record(self, renderer, *args, **kwargs):
        if self.get_visible() and self.get_text().strip():
            box = Text.get_window_extent(self, renderer)
            seen.append(Box(self.get_text(), box.x0, box.y0, box.x1, box.y1))
        return draw(self, renderer, *args, **kwargs)

    with mock.patch.object(Text, "draw", record):
        figure.draw_without_rendering()
    return seen


def faults(figure, boxes):
    """Return what is wrong with the texts of a figure: outside of it, or over each other."""
    width, height = figure.bbox.width, figure.bbox.height
    found = [
        f"{box.text!r} is outside: {box.x0:.0f} to {box.x1:.0f} of {width:.0f}, "
        f"{box.y0:.0f} to {box.y1:.0f} of {height:.0f}"
        for box in boxes
        if box.x0 < -TOUCH or box.y0 < -TOUCH or box.x1 > width + TOUCH or box.y1 > height + TOUCH
    ]
    found += [f"{a.text!r} covers {b.text!r}" for a, b in combinations(boxes, 2) if a.covers(b)]
    return found
