"""The compiled half of the package. Voltages are in volts, positions in micrometres, sample rates in hertz."""

from collections.abc import Iterator, Mapping, Sequence
from os import PathLike
from typing import Any, Literal, TypedDict, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray
from typing_extensions import NotRequired

from ._show import Page

Role = Literal["identify", "validate"]
Family = Literal["pi", "mpi", "wrpi", "mrpi", "play-polynomial"]
Array = NDArray[np.float64]
Path = str | PathLike[str]

__version__: str

class Error(ValueError):
    """Bad input: the message says what, which value, what is allowed, and what to do."""

class Series(TypedDict):
    time: Array
    input: Array
    measured: Array
    modelled: Array

class NextRecord(TypedDict):
    excitation: str
    u: Array
    fs: float
    u2: NotRequired[Array]

class Record:
    """One uniformly sampled run of the stage; its arrays are views that cannot be written to."""

    @property
    def name(self) -> str: ...
    @property
    def role(self) -> Role: ...
    @property
    def excitation(self) -> str: ...
    @property
    def fs(self) -> float: ...
    @property
    def time(self) -> Array: ...
    @property
    def u(self) -> Array: ...
    @property
    def y(self) -> Array: ...
    @property
    def reference(self) -> Array | None: ...
    @property
    def temperature(self) -> Array | None: ...
    @property
    def voltage2(self) -> Array | None: ...
    def __len__(self) -> int: ...

class Dataset:
    """A set of records of one stage."""

    name: str
    @staticmethod
    def from_arrays(
        u: ArrayLike | Sequence[ArrayLike],
        y: ArrayLike | Sequence[ArrayLike],
        fs: float | Sequence[float],
        *,
        role: Role | Sequence[Role] | None = None,
        name: str = "arrays",
        reference: ArrayLike | Sequence[ArrayLike] | None = None,
        temperature: ArrayLike | Sequence[ArrayLike] | None = None,
        voltage2: ArrayLike | Sequence[ArrayLike] | None = None,
    ) -> Dataset: ...
    @staticmethod
    def from_dataframe(
        table: Any,
        *,
        u: str = "voltage_v",
        y: str = "position_um",
        time: str = "time_s",
        fs: float | None = None,
        role: Role = "identify",
        name: str = "table",
    ) -> Dataset: ...
    @overload
    def append(self, u: Dataset) -> None: ...
    @overload
    def append(
        self,
        u: ArrayLike,
        y: ArrayLike,
        fs: float,
        *,
        role: Role = "identify",
        name: str | None = None,
        reference: ArrayLike | None = None,
        temperature: ArrayLike | None = None,
        voltage2: ArrayLike | None = None,
    ) -> None: ...
    def save(self, path: Path, *, overwrite: bool = False) -> None: ...
    @property
    def notices(self) -> list[str]: ...
    @property
    def records(self) -> list[Record]: ...
    def plot(self) -> Any: ...
    def __len__(self) -> int: ...
    def __getitem__(self, index: int) -> Record: ...
    def __iter__(self) -> Iterator[Record]: ...

class Model:
    """A fitted model: a hysteresis, and the effects around it."""

    @staticmethod
    def load(path: Path) -> Model: ...
    @staticmethod
    def from_toml(text: str) -> Model: ...
    def save(self, path: Path) -> None: ...
    def to_toml(self) -> str: ...
    def predict(self, u: ArrayLike, fs: float) -> Array: ...
    def residual(self, dataset: Dataset) -> list[Array]: ...
    @property
    def family(self) -> Family: ...
    @property
    def direction(self) -> Literal["forward", "inverse"]: ...
    @property
    def thresholds(self) -> list[float]: ...
    @property
    def parameters(self) -> list[dict[str, Any]]: ...
    @property
    def effects(self) -> list[dict[str, Any]]: ...
    @property
    def notices(self) -> list[str]: ...

class Comparison:
    """A model against the records."""

    @property
    def validate(self) -> dict[str, Any] | None: ...
    @property
    def identify(self) -> dict[str, Any] | None: ...
    @property
    def records(self) -> list[dict[str, Any]]: ...
    @property
    def series(self) -> list[Series]: ...
    def to_dict(self) -> dict[str, Any]: ...
    def page(self) -> Page: ...
    def plot(self) -> Any: ...

class Diagnosis:
    """What a model lacks."""

    @property
    def verdict(self) -> str: ...
    @property
    def ranking(self) -> list[dict[str, Any]]: ...
    @property
    def next_record(self) -> NextRecord | None: ...
    def to_dict(self) -> dict[str, Any]: ...
    def page(self, *, progress: bool = True) -> Page: ...
    def plot(self) -> Any: ...

class Ladder:
    """How the error fell, step by step."""

    @property
    def steps(self) -> list[dict[str, Any]]: ...
    def to_dict(self) -> dict[str, Any]: ...
    def page(self) -> Page: ...
    def plot(self) -> Any: ...

class Learned:
    """What was learned, and why it stopped."""

    @property
    def model(self) -> Model: ...
    @property
    def attempts(self) -> list[dict[str, Any]]: ...
    @property
    def stop(self) -> dict[str, Any]: ...
    @property
    def ladder(self) -> Ladder | None: ...
    @property
    def diagnosis(self) -> Diagnosis: ...
    def to_dict(self) -> dict[str, Any]: ...
    def plot(self) -> Any: ...

class Controller:
    """A designed controller."""

    @staticmethod
    def load(path: Path) -> Controller: ...
    def save(self, path: Path) -> None: ...
    def law(self, kind: Literal["f32", "f64"] = "f64", *, temperature: float = 0.0) -> Law: ...
    def voltages(self, reference: ArrayLike) -> Array: ...
    @property
    def samples_ahead(self) -> int: ...
    @property
    def fs(self) -> float: ...
    @property
    def volts(self) -> tuple[float, float]: ...
    @property
    def feedback(self) -> dict[str, Any] | None: ...
    def to_dict(self) -> dict[str, Any]: ...

class Law:
    """A controller's law with its state: the code that runs on the chip."""

    @overload
    def step(
        self,
        reference: float,
        reading: float | None = None,
        *,
        voltage2: float | None = None,
        temperature: float | None = None,
    ) -> float: ...
    @overload
    def step(
        self,
        reference: ArrayLike,
        reading: ArrayLike | None = None,
        *,
        voltage2: ArrayLike | None = None,
        temperature: ArrayLike | None = None,
    ) -> Array: ...
    def reset(self) -> None: ...
    @property
    def ahead(self) -> int: ...
    @property
    def kind(self) -> Literal["f32", "f64"]: ...
    @property
    def limited(self) -> bool: ...

class Explanation:
    """An effect in words."""

    @property
    def name(self) -> str: ...
    @property
    def summary(self) -> str: ...
    @property
    def paragraphs(self) -> list[tuple[str, str]]: ...
    @property
    def parameters(self) -> list[dict[str, str]]: ...

def read(
    path: Path,
    *,
    role: Role = "identify",
    columns: Mapping[str, str] | None = None,
    fs: float | None = None,
) -> Dataset: ...
def example(name: str, *, progress: bool = True) -> Dataset: ...
def examples() -> dict[str, str]: ...
def simulate(
    stage: str,
    u: ArrayLike | None = None,
    fs: float | None = None,
    *,
    seed: int = 1,
    role: Role = "identify",
    progress: bool = True,
) -> Dataset: ...
def fit(
    dataset: Dataset,
    model: Family = "mrpi",
    *,
    plays: int = 10,
    thresholds: Literal["data", "eq16", "log"] = "data",
    direction: Literal["forward", "inverse"] = "forward",
    method: Literal["separable", "mpso"] = "separable",
    seed: int = 1,
    progress: bool = True,
) -> Model: ...
def add(dataset: Dataset, model: Model, effect: str, *, progress: bool = True) -> Model: ...
def compare(dataset: Dataset, model: Model, *, progress: bool = True) -> Comparison: ...
def diagnose(
    dataset: Dataset, model: Model, *, effects: Sequence[Path] = (), progress: bool = True
) -> Diagnosis: ...
def learn(
    dataset: Dataset,
    model: Family = "mpi",
    *,
    plays: int = 10,
    effects: Sequence[Path] = (),
    progress: bool = True,
) -> Learned: ...
def ladder(model: Model) -> Ladder: ...
def design(
    source: Model | Dataset,
    *,
    reference: Literal["previewed", "live"] = "previewed",
    volts: tuple[float, float] | None = None,
    rate_hz: float | None = None,
    along: Dataset | None = None,
    margin: float | None = None,
    rigid_hz: float | None = None,
    beyond_records: bool = False,
    open: bool = False,
    progress: bool = True,
) -> Controller: ...
def explain(effect: str) -> Explanation: ...
def effects() -> list[tuple[str, str]]: ...
