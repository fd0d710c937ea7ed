"""The colours of the pages can be read, by day and by night."""

import re

import pytest

from clients.web.routes import ASSETS

LEAST_CONTRAST = 4.5
"""Of text, by the Web Content Accessibility Guidelines 2.2, level AA."""
PAIRS = [
    *((ink, ground) for ink in ("ink", "soft", "link", "blue", "red") for ground in ("ground", "panel")),
    ("bad", "bad-ground"),
    ("panel", "link"),
    ("unit-ink-blue", "unit-blue"),
    ("unit-ink-red", "unit-red"),
]


def luminance(colour: str) -> float:
    parts = [int(colour[at : at + 2], 16) / 255 for at in (1, 3, 5)]
    red, green, blue = (part / 12.92 if part <= 0.03928 else ((part + 0.055) / 1.055) ** 2.4 for part in parts)
    return 0.2126 * red + 0.7152 * green + 0.0722 * blue


def contrast(one: str, other: str) -> float:
    darker, lighter = sorted((luminance(one), luminance(other)))
    return (lighter + 0.05) / (darker + 0.05)


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_text_stands_out_from_its_ground(scheme: str) -> None:
    light, dark = (ASSETS / "style.css").read_text().split("@media (prefers-color-scheme: dark)")
    colours = dict(re.findall(r"--([\w-]+): (#[0-9a-f]{6})", light if scheme == "light" else dark))

    weak = {pair: round(contrast(*(colours[name] for name in pair)), 2) for pair in PAIRS}
    assert {pair: value for pair, value in weak.items() if value < LEAST_CONTRAST} == {}
    assert contrast("#000000", "#ffffff") == pytest.approx(21)
