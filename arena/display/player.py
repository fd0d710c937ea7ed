"""The player of a replay as a state machine without I/O: keys and the time go in, the tick to show comes out."""

from collections.abc import Callable, Iterator, Sequence

from arena.display.drawings import list_labels
from arena.display.scene import Scene, View
from arena.errors import ArenaError

KEYS = (
    ("space", "play, or pause"),
    ("right, left", "the next tick, the one before"),
    ("home, end", "the first tick, the last"),
    ("n, N", "the next fight, fall or capture, the one before; of a transcript, the next loss or change of the score"),
    ("+, -", "faster, slower"),
    ("v", "the next view"),
    ("u", "numbers on the units, or letters"),
    ("l, d", "what the bot logged, what it drew: on and off"),
    ("m", "of its heat maps that have a name, the next alone; after the last, all"),
    ("down, up", "scroll, where the board is higher than the screen"),
    ("?", "these keys"),
    ("q", "leave"),
)
"""What each key does, for people."""
_FASTER, _LEAST_PER_S, _MOST_PER_S = 2.0, 0.1, 1000.0


class Recording:
    """The scenes of a match, read or played no further than somebody looks."""

    def __init__(self, scenes: Iterator[Scene], last: int | None = None) -> None:
        """Take scenes from the first on; `last` is the number of the last, where it is known."""
        self._source, self._scenes = scenes, list[Scene]()
        self._last = last
        self._is_whole = False
        self.error: ArenaError | None = None
        """Why there are no more scenes, if the match does not simply end there."""

    def __len__(self) -> int:
        """Return how many scenes there are so far."""
        return len(self._scenes)

    @property
    def last(self) -> int | None:
        """The number of the last tick; None while nobody knows it."""
        return len(self._scenes) - 1 if self._is_whole else self._last

    def find(self, number: int) -> Scene | None:
        """Return a scene by its number; None behind the last."""
        while len(self._scenes) <= number and not self._is_whole:
            try:
                self._scenes.append(next(self._source))
            except StopIteration:
                self._is_whole = True
            except ArenaError as error:
                self._is_whole, self.error = True, error
        return self._scenes[number] if number < len(self._scenes) else None


class Player:
    """Which tick of a recording is shown, and how.

    Parameters
    ----------
    views
        At least one; the first is shown first.
    ticks_per_s
        The speed at which it plays.
    """

    def __init__(
        self, recording: Recording, views: Sequence[View], ticks_per_s: float, now_s: float, *, is_playing: bool = True
    ) -> None:
        self._recording, self._views = recording, views
        self.number, self.ticks_per_s, self.is_playing = 0, ticks_per_s, is_playing
        self.view = views[0]
        self.has_numbers = self.shows_log = self.shows_drawings = True
        self.heat_label = ""
        """Of the heat map that is shown alone; empty for all."""
        self.shows_keys = self.is_over = False
        self.first_row = 0
        """The first row of the board that is on the screen, where the board is higher; the screen bounds it."""
        self._next_s = now_s + 1 / ticks_per_s
        self._actions: dict[str, Callable[[], object]] = {
            "right": lambda: self._step(1),
            "left": lambda: self._step(-1),
            "home": lambda: self._go(0),
            "end": self._go_to_the_end,
            "n": lambda: self._seek(1),
            "N": lambda: self._seek(-1),
            "+": lambda: self._change_speed(_FASTER),
            "=": lambda: self._change_speed(_FASTER),
            "-": lambda: self._change_speed(1 / _FASTER),
            "down": lambda: self._scroll(1),
            "up": lambda: self._scroll(-1),
        }

    @property
    def scene(self) -> Scene | None:
        """What is shown; None of a match without ticks."""
        return self._recording.find(self.number)

    @property
    def last(self) -> int | None:
        """The number of the last tick; None while nobody knows it."""
        return self._recording.last

    def press(self, key: str, now_s: float) -> None:
        """Do what a key says; one that says nothing is ignored. A key that moves through the match stops it from playing."""
        if key == "space":
            self._play_or_pause(now_s)
        elif key == "v":
            self.view = self._views[(self._views.index(self.view) + 1) % len(self._views)]
        elif key in ("u", "l", "d", "?"):
            name = {"u": "has_numbers", "l": "shows_log", "d": "shows_drawings", "?": "shows_keys"}[key]
            setattr(self, name, not getattr(self, name))
        elif key == "m":
            self._choose_heat()
        elif key == "q":
            self.is_over = True
        elif key in self._actions:
            self._actions[key]()
            self._next_s = now_s + 1 / self.ticks_per_s

    def advance(self, now_s: float) -> None:
        """Let time pass: where it plays, one tick further once it is time for it."""
        if self.is_playing and now_s >= self._next_s:
            due_s = self._next_s + 1 / self.ticks_per_s
            self._next_s = due_s if due_s > now_s else now_s + 1 / self.ticks_per_s  # ticks that were missed are not made up for
            self._move(1)

    def wait_s(self, now_s: float) -> float | None:
        """Return how long nothing changes by itself, in seconds; None while it does not play."""
        return max(self._next_s - now_s, 0.0) if self.is_playing else None

    def _play_or_pause(self, now_s: float) -> None:
        if not self.is_playing and self._recording.find(self.number + 1) is None:
            self.number = 0  # at the end: once more from the start
        self.is_playing = not self.is_playing
        self._next_s = now_s + 1 / self.ticks_per_s

    def _change_speed(self, factor: float) -> None:
        self.ticks_per_s = min(max(self.ticks_per_s * factor, _LEAST_PER_S), _MOST_PER_S)

    def _choose_heat(self) -> None:
        labels = ["", *list_labels(self.scene.drawings if self.scene else ())]
        at = labels.index(self.heat_label) + 1 if self.heat_label in labels else 0
        self.heat_label = labels[at % len(labels)]

    def _scroll(self, rows: int) -> None:
        self.first_row = max(self.first_row + rows, 0)

    def _step(self, by: int) -> None:
        self.is_playing = False
        self._move(by)

    def _go(self, number: int) -> None:
        self.is_playing, self.number = False, number

    def _move(self, by: int) -> None:
        if self.number + by >= 0 and self._recording.find(self.number + by) is not None:
            self.number += by
        else:
            self.is_playing = False

    def _go_to_the_end(self) -> None:
        number = self.number
        while self._recording.find(number + 1) is not None:
            number += 1
        self._go(number)

    def _seek(self, by: int) -> None:
        """Go to the next tick with an event, or to where the match ends or begins."""
        number = self.number
        while number + by >= 0 and (scene := self._recording.find(number + by)) is not None:
            number += by
            if scene.is_event:
                break
        self._go(number)
