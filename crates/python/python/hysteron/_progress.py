"""A bar on standard error, where tqdm is installed."""

from __future__ import annotations

import warnings
from typing import Any

STEPS = 1000


class Bar:
    """A bar from 0 to 1. It shows only on a terminal or in a notebook, and not before half a second."""

    def __init__(self, label: str) -> None:
        self._bar: Any = None
        try:
            with warnings.catch_warnings():
                # A notebook without widgets gets a bar of text.
                warnings.simplefilter("ignore")
                from tqdm.auto import tqdm
        except ImportError:
            return
        self._bar = tqdm(
            total=STEPS,
            desc=label,
            delay=0.5,
            leave=False,
            disable=None,
            bar_format="{desc:<24} |{bar}| {percentage:3.0f} % {remaining} left",
        )

    def at(self, share: float, what: str) -> None:
        """Moves the bar to a share done."""
        if self._bar is None:
            return
        if what:
            self._bar.set_description_str(what, refresh=False)
        done = int(STEPS * min(max(share, 0.0), 1.0))
        if done < self._bar.n:
            self._bar.reset()
        self._bar.update(done - self._bar.n)

    def close(self) -> None:
        """Takes the bar away."""
        if self._bar is not None:
            self._bar.close()


def bar(label: str) -> Bar:
    """A bar with a label."""
    return Bar(label)
