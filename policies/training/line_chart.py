"""Draw curves with their spread as SVG: a page of text, which every browser and every repository shows."""

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape

import numpy as np
from numpy.typing import NDArray

COLOURS = ("#1f6fb4", "#c8502d", "#2f8f4e", "#7a4fb5", "#9a7b12", "#4a4a4a")
"""Of the curves, told apart by people who see no difference between red and green, too; a seventh begins anew."""
_WIDTH, _HEIGHT = 720, 400
_LEFT, _RIGHT, _TOP, _BOTTOM = 64, 16, 36, 52
_LINE_PX = 16
_STEPS = (1, 2, 5)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Curve:
    """A line with the band that its runs lie in; all arrays are of one length."""

    label: str
    x: NDArray[np.float64]
    low: NDArray[np.float64]
    middle: NDArray[np.float64]
    high: NDArray[np.float64]


def draw(title: str, x_label: str, y_label: str, curves: Sequence[Curve], y_range: tuple[float, float]) -> str:
    """Return a chart of curves over one pair of axes, as SVG.

    Parameters
    ----------
    y_range
        Ends of the vertical axis; the horizontal one begins at 0 and ends with the longest curve.
    """
    last = max((float(curve.x[-1]) for curve in curves if len(curve.x)), default=1.0)
    low, high = y_range

    def across(x: float) -> float:
        return round(_LEFT + (_WIDTH - _LEFT - _RIGHT) * x / last, 1)

    def down(y: float) -> float:
        return round(_HEIGHT - _BOTTOM - (_HEIGHT - _TOP - _BOTTOM) * (min(max(y, low), high) - low) / (high - low), 1)

    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {_WIDTH} {_HEIGHT}" role="img" aria-label="{escape(title)}"'
        ' font-family="sans-serif" font-size="12" fill="#222">',
        f'<rect width="{_WIDTH}" height="{_HEIGHT}" fill="#fff"/>',
        f'<text x="{_LEFT}" y="20" font-size="14" font-weight="bold">{escape(title)}</text>',
    ]
    for y in ticks(low, high):
        parts.append(f'<path d="M{_LEFT} {down(y)}H{_WIDTH - _RIGHT}" stroke="#ddd"/>')
        parts.append(f'<text x="{_LEFT - 8}" y="{down(y) + 4}" text-anchor="end">{y:g}</text>')
    for x in ticks(0, last):
        parts.append(f'<text x="{across(x)}" y="{_HEIGHT - _BOTTOM + 18}" text-anchor="middle">{x:,.0f}</text>')
    middle_x, middle_y = (_LEFT + _WIDTH - _RIGHT) / 2, (_TOP + _HEIGHT - _BOTTOM) / 2
    parts.append(f'<text x="{middle_x}" y="{_HEIGHT - 12}" text-anchor="middle">{escape(x_label)}</text>')
    parts.append(f'<text transform="translate(16 {middle_y}) rotate(-90)" text-anchor="middle">{escape(y_label)}</text>')
    for number, curve in enumerate(curves):
        colour = COLOURS[number % len(COLOURS)]
        there = [f"{across(x)} {down(y)}" for x, y in zip(curve.x, curve.high, strict=True)]
        back = [f"{across(x)} {down(y)}" for x, y in zip(curve.x[::-1], curve.low[::-1], strict=True)]
        line = [f"{across(x)} {down(y)}" for x, y in zip(curve.x, curve.middle, strict=True)]
        if line:
            parts.append(f'<path d="M{" L".join(there + back)}Z" fill="{colour}" fill-opacity="0.18"/>')
            parts.append(f'<path d="M{" L".join(line)}" fill="none" stroke="{colour}" stroke-width="2"/>')
        y = _TOP + 14 + _LINE_PX * number
        parts.append(f'<path d="M{_LEFT + 12} {y - 4}h22" stroke="{colour}" stroke-width="3"/>')
        parts.append(f'<text x="{_LEFT + 40}" y="{y}">{escape(curve.label)}</text>')
    return "\n".join([*parts, "</svg>"]) + "\n"


def ticks(low: float, high: float, most: int = 8) -> list[float]:
    """Return round numbers from `low` to `high`, at most about `most` of them."""
    span, size = high - low, 1.0
    while size * 10 <= span / most:
        size *= 10
    while size > span:
        size /= 10
    step = next((size * one for one in _STEPS if span / (size * one) <= most), size * 10)
    first = int(np.ceil(low / step - 1e-9))
    return [round(number * step, 9) for number in range(first, int(np.floor(high / step + 1e-9)) + 1)]
