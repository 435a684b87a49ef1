"""Values that a sweep can go through."""

from __future__ import annotations

from collections import Counter

from ..post.grid import value_text


def complaint(values: object) -> tuple[str, str] | None:
    """What is wrong with the values of a key, and what was expected; None when they are fine."""
    expected = "at least one value, each once: numbers, texts or arrays"
    if not isinstance(values, list) or not values:
        return "gives no array of values", expected
    texts = [value_text(value) for value in values]
    if any(isinstance(value, dict) for value in values):
        return "has a table among the values", expected
    twice = [text for text, count in Counter(texts).items() if count > 1]
    return (f"has the value {twice[0]} twice", expected) if twice else None
