"""One small world on both processors, for test_cuda.py: python both_processors.py OUT.pickle HEIGHT WIDTH.

A process of its own, since numba's simulator of a GPU must be chosen before numba is imported.
"""

import pickle
import sys
import threading
import warnings
from dataclasses import replace
from pathlib import Path

import numba
import numpy as np

from evimo.geometry.camera import Camera
from evimo.scene.bodies import BOX, CYLINDER, ELLIPSOID, GRATING, MESH, Body, Part, Scene, Surface
from evimo.scene.cuda_renderer import CudaRenderer
from evimo.scene.meshes.bank import mesh_bank
from evimo.scene.motion import Motion, random_rotation, wander
from evimo.scene.rays.on_device import SIMULATED, cuda, uploaded
from evimo.scene.renderer import Renderer
from evimo.scene.textures.bank import texture_bank
from evimo.simulate import film
from evimo.simulate.bands import Exposures, Fed
from evimo.simulate.cuda_film import CudaFilm, blurred_on_gpu
from evimo.simulate.cuda_pixels import CudaPixels
from evimo.simulate.film import Film
from evimo.simulate.pixels import Pixels, blurred
from evimo.simulate.plan import RecordingPlan
from evimo.simulate.prepared import filmed
from evimo.simulate.recording import SimulatedRecording
from evimo.simulate.sensor import SensorSettings

NOISY = SensorSettings(contrast=0.1, refractory_s=0.0, shot_hz=60.0, shot_light=5.0, jitter_s=1e-4, hot_share=0.05)
SENSORS = {
    "quiet": SensorSettings(contrast=0.1),
    "noisy": NOISY,
    "under lamps": replace(NOISY, flicker_depth=0.3, refractory_s=0.001),
    "infinitely fast": SensorSettings(contrast=0.1, bandwidth_hz=0.0),
}
PYRAMID = (
    np.array([(1, 1, 0), (-1, 1, 0), (-1, -1, 0), (1, -1, 0), (0, 0, 1.5)], float),
    np.array([(0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4), (2, 1, 0), (0, 3, 2)]),
)


def world() -> Scene:
    """A room, a net, a mesh that stands and two movers, in light that throws shadows."""
    rng = np.random.default_rng(4)

    def part(shape, half, position, *, gloss=0.0, **how):
        surface = Surface(int(rng.integers(2, 12)), 0.4, (0.1, 0.2), 0.1, 0.9, gloss)
        return Part(shape, np.array(half), np.array(position), random_rotation(rng), surface, **how)

    def motion(position):
        moves, turns = wander(rng, 0.5, (0.5, 2.0)), wander(rng, 2.0, (0.5, 2.0))
        return Motion(np.array(position, float), random_rotation(rng), (moves,), turns)

    room = part(BOX, (2.0, 1.5, 3.0), (0, 0, 0), inside=True)
    net = part(GRATING, (0.4, 0.4, 0.01), (-0.3, 0.3, 1.2), openings=(4.0, 3.0, 0.4, 0.3))
    bodies = (
        Body((replace(room, rotation=np.eye(3)), net)),
        Body(
            (part(BOX, (0.2, 0.1, 0.15), (0, 0, 0)), part(ELLIPSOID, (0.1, 0.2, 0.1), (0.2, 0, 0))), motion((0, 0, 1))
        ),
        Body((part(CYLINDER, (0.1, 0.14, 0.2), (0, 0.05, 0), gloss=0.3),), motion((0.4, -0.3, 1.0))),
        Body((part(MESH, (0.25, 0.25, 0.25), (0.4, 0.3, 1.4), mesh=0),), clutter=True),
    )
    eye = Motion(np.zeros(3), np.eye(3), (wander(rng, 0.3, (0.5, 2)),), wander(rng, 0.8, (0.5, 2)))
    bank, light = texture_bank(7, plain=2, dense=10), np.array([0.6, 0.0, -0.8])
    return Scene(bodies, eye, light, 0.5, bank, mesh_bank([PYRAMID]), lamp=0.1)


def lens(height: int, width: int) -> Camera:
    """A wide lens with distortion."""
    at = {"cx": 0.52 * width, "cy": 0.47 * height, "height": height, "width": width}
    return Camera(fx=0.6 * width, fy=0.62 * width, distortion=(-0.3, 0.08, 1e-3, -5e-4), **at)


def fed_with(image: np.ndarray, at: Exposures, settings: SensorSettings) -> Fed:
    """What pixels read in frames (F, H, W), which `at` names, by NumPy."""
    share, lamp, pace = (values[:, None, None] for values in (at.share, at.lamp, at.pace))
    before, after = image[at.before], image[np.minimum(at.before + 1, len(image) - 1)]
    light = (before + (after - before) * share) * lamp + np.float32(settings.floor)
    lag = decay = np.empty((0, 0), np.float32)
    if settings.bandwidth_hz:
        lag, decay = (values.reshape(len(light), -1) for values in (1 / (light * pace), np.exp(-light * pace)))
    return Fed(at.time_s, np.log(light).reshape(len(light), -1), lag, decay)


def events_of_both(image: np.ndarray, time_s: np.ndarray, settings: SensorSettings) -> tuple[list, list, tuple]:
    """Of two calls in turn on each processor, from the very same signal; and the second call's signal on each."""
    pixels = [Pixels(settings, np.random.default_rng(1), first=image[0], start_s=0.0) for _ in range(2)]
    on_gpu, mine, theirs = CudaPixels(pixels[1]), [], []
    for frames, times in ((image, time_s), (np.ascontiguousarray(image[::-1]), time_s + time_s[-1])):
        at = pixels[0].exposures(times)
        fed = fed_with(frames, at, settings)
        mine.append(pixels[0].events_of(fed))
        theirs.append(on_gpu.events(uploaded(fed)))
    its = on_gpu.fed(cuda.to_device(frames), at)
    return mine, theirs, (fed, [values.copy_to_host() for values in its])


def compared(height: int, width: int) -> dict:
    """What both processors make of the world, by name."""
    renderer, times = Renderer(world(), lens(height, width)), np.array([0.0, 0.31])
    found = {"frames": (renderer.frames(times), [a.copy_to_host() for a in CudaRenderer(renderer).frames(times)])}
    found["ids"] = renderer.packed.ids
    rng = np.random.default_rng(0)
    image = np.exp(np.cumsum(rng.normal(size=(4, height, width)) * 0.4, axis=0) - 1).astype(np.float32)
    on_gpu, sigmas = cuda.to_device(image), (0.45, 0.9, 1.6)
    found["blurred"] = {s: (blurred(image, s), blurred_on_gpu(on_gpu, s).copy_to_host()) for s in sigmas}
    time_s = np.linspace(0, 0.02, 4)
    found["events"] = {name: events_of_both(image, time_s, settings) for name, settings in SENSORS.items()}
    stretch = np.linspace(0, 0.01, 5)
    films = [kind(renderer, NOISY, np.random.default_rng(2), start_s=0.0) for kind in (Film, CudaFilm)]
    found["film"] = [one.run(stretch, np.ones(renderer.cones.shape[:2], np.int32)) for one in films]
    recording = SimulatedRecording(RecordingPlan(seed=1, seconds=0.05), renderer.camera, renderer.scene, NOISY)
    found["prepared"] = [
        filmed(replace(recording, plan=replace(recording.plan, device=device))) for device in ("cpu", "cuda")
    ]
    return found


def without_threads() -> None:
    """Let the simulator take a block's threads in turn: a Python thread for each takes most of its time."""
    from numba.cuda.simulator import kernel

    def run(block, place, *arguments):
        me = threading.current_thread()
        me.blockIdx = kernel.Dim3(*place)
        for thread in np.ndindex(*block._block_dim):
            me.threadIdx = kernel.Dim3(*thread)
            block._f(*arguments)

    kernel.BlockManager.run = run


if __name__ == "__main__":
    if SIMULATED:
        warnings.simplefilter("ignore")  # numpy's numbers complain where the generator's overflow, as they should
        without_threads()
        film.SHORTEST_S = film.LONGEST_S = 0.00625  # few frames
    numba.set_num_threads(1)
    Path(sys.argv[1]).write_bytes(pickle.dumps(compared(int(sys.argv[2]), int(sys.argv[3]))))
