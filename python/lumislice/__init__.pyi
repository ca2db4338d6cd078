from collections.abc import Callable, Sequence
from os import PathLike
from typing import Any, TypedDict, final

import numpy as np
from numpy.typing import ArrayLike, NDArray
from typing_extensions import NotRequired

__version__: str

Progress = Callable[[str, int, int], object]
Layers = str | Sequence[tuple[str, float]]

class InputError(ValueError): ...

class Coefficients(TypedDict):
    scattering_per_mm: NDArray[np.float64]
    absorption_per_mm: NDArray[np.float64]
    g: NDArray[np.float64]
    refractive_index: float

class Profile(TypedDict):
    r_mm: NDArray[np.float64]
    reflection_per_mm2: NDArray[np.float64]
    transmission_per_mm2: NDArray[np.float64]

class Prediction(TypedDict):
    channels: list[str]
    reflection: NDArray[np.float64]
    transmission: NDArray[np.float64]
    k_rad_per_mm: NDArray[np.float64]
    reflection_hankel: NDArray[np.float64]
    transmission_hankel: NDArray[np.float64]
    glint: NDArray[np.float64]
    half_energy_radius_mm: NDArray[np.float64]
    # With profiles=True, one for each channel.
    profiles: NotRequired[list[Profile]]

class Match(TypedDict):
    stack: list[tuple[str, float]]
    objective: dict[str, float | None]
    albedo_asked: NDArray[np.float64]
    albedo: NDArray[np.float64]
    reflection_hankel: NDArray[np.float64]

class ChannelGamut(TypedDict):
    channel: str
    albedo: NDArray[np.float64]
    narrow: NDArray[np.float64]
    wide: NDArray[np.float64]
    point_albedo: NDArray[np.float64]
    point_half_energy_radius_mm: NDArray[np.float64]
    point_place: list[str]
    point_stack: list[list[tuple[str, float]]]

class Gamut(TypedDict):
    model: str
    channels: list[ChannelGamut]

class Measured(TypedDict):
    files: dict[str, str]
    notes: list[str]

@final
class Materials:
    @property
    def name(self) -> str: ...
    @property
    def provenance(self) -> str: ...
    @property
    def channels(self) -> list[str]: ...
    @property
    def resins(self) -> list[str]: ...
    @property
    def warnings(self) -> list[str]: ...
    @property
    def k_rad_per_mm(self) -> NDArray[np.float64]: ...
    def coefficients(self, resin: str) -> Coefficients | None: ...

def materials(name: str, *, progress: Progress | None = None) -> Materials: ...
def predict(
    materials: Materials | str | PathLike[str],
    stack: Layers,
    *,
    core: str | None = None,
    model: str = "transport",
    light: str = "diffuse",
    accuracy: float = 3e-4,
    photons: int | None = None,
    seed: int | None = None,
    profiles: bool = False,
    progress: Progress | None = None,
) -> Prediction: ...
def match(
    materials: Materials | str | PathLike[str],
    *,
    albedo: ArrayLike | None = None,
    mean_free_path_mm: ArrayLike | None = None,
    reflection_hankel: ArrayLike | None = None,
    core: str | None = None,
    max_thickness_mm: float = 5.0,
    min_depth_mm: dict[str, float] | None = None,
    units: int = 64,
    depth: int = 6,
    objective: str = "natural",
    dc_weight: float = 1.0,
    model: str = "transport",
    min_layer_mm: float | None = None,
    layer_step_mm: float | None = None,
    mixtures: bool = True,
    progress: Progress | None = None,
) -> list[Match]: ...
def gamut(
    materials: Materials | str | PathLike[str],
    *,
    core: str | None = None,
    max_thickness_mm: float = 5.0,
    min_depth_mm: dict[str, float] | None = None,
    depth: int = 6,
    model: str | None = None,
    min_layer_mm: float | None = None,
    layer_step_mm: float | None = None,
    progress: Progress | None = None,
) -> Gamut: ...
def slice(
    job: str | PathLike[str],
    output: str | PathLike[str] | None = None,
    *,
    overwrite: bool = False,
    resume: bool = False,
    slices: tuple[int, int] | None = None,
    progress: Progress | None = None,
) -> dict[str, Any]: ...
def look(
    job: str | PathLike[str],
    folder: str | PathLike[str] | None = None,
    *,
    spots: int = 100,
    at: Sequence[tuple[float, float, float]] = ...,
    photons: int = 10_000,
    seed: int = 1,
    output: str | PathLike[str] | None = None,
    overwrite: bool = False,
    size: int = 640,
    samples: int = 64,
    progress: Progress | None = None,
) -> dict[str, Any]: ...
def factor(
    dataset: str | PathLike[str],
    output: str | PathLike[str],
    *,
    luminance: bool = False,
    clusters: int | None = None,
    max_rms: float | None = None,
    seed: int = 1,
    dc_weight: float = 1.0,
    rounds: int | None = None,
    roughness: float | None = None,
    compare: bool = False,
    overwrite: bool = False,
    progress: Progress | None = None,
) -> dict[str, Any]: ...
def measure(
    capture: str | PathLike[str], *, stem: str = "material", progress: Progress | None = None
) -> Measured: ...
