"""Animations: frames of one size, with one camera and one scale of colors, to ``.gif`` or ``.mp4``."""

from __future__ import annotations

import subprocess
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from kratos_lite.atomic import replacing
from kratos_lite.errors import InputError, KratosLiteError
from kratos_lite.typing import Numbers
from kratos_lite.validation import path_of
from kratos_lite.view import canvas
from kratos_lite.view.figure import compose, draw_body
from kratos_lite.view.scene import Options, Subject, scene_of

ENDINGS = (".gif", ".mp4")
WHITE = 248
"""Red, green and blue from which a color is taken for white."""
FACETS = 5000
"""Facets of a frame to aim at."""


def check_animation(path: str | Path) -> None:
    """Raise, before any work is done, for a film that cannot be written."""
    ending = path_of(path).suffix.lower()
    if ending not in ENDINGS:
        raise InputError(f"{path}: animations are written as {' or '.join(ENDINGS)}; got {ending!r}")
    canvas.file_types()
    if ending == ".mp4":
        _ffmpeg(path)


def write_animation(
    path: str | Path, series: Sequence[Sequence[Subject]], options: Options, fps: float
) -> None:
    """Write a film, each of its frames some subjects side by side, whole or not at all."""
    check_animation(path)
    pictures = frames(series, options)
    with replacing(path) as file:
        if Path(path).suffix.lower() == ".gif":
            _write_gif(file, pictures, fps)
        else:
            _write_mp4(path, file, pictures, fps)


def frames(series: Sequence[Sequence[Subject]], options: Options) -> Iterator[Numbers]:
    """Yield frames (height, width, 3) uint8, each of some subjects side by side, with titles above them."""
    everything = [subject for subjects in series for subject in subjects]
    scene = scene_of(everything, options)
    scene.subjects = series[0]
    longest = max((subject.title for subject in everything), key=len)
    figure, panels, inch = compose(scene, options, title=longest)
    for subjects in series:
        drawn = []
        for axes, subject in zip(panels, subjects, strict=True):
            axes.title.set_text(subject.title)
            drawn += draw_body(axes, scene, subject, inch, FACETS // len(panels))[0]
        yield canvas.pixels(figure)
        for artist in drawn:
            artist.remove()


def _write_gif(file: Path, pictures: Iterator[Numbers], fps: float) -> None:
    """Write frames with one palette for all, so that what stands still does not flicker."""
    from PIL import Image

    images = [Image.fromarray(pixels) for pixels in pictures]
    sample = Image.fromarray(np.concatenate([np.asarray(image) for image in images[:: -(-len(images) // 4)]]))
    palette = sample.quantize(256, Image.Quantize.MEDIANCUT)
    colors = np.reshape(palette.getpalette() or [255, 255, 255], (-1, 3))
    colors[(colors >= WHITE).all(axis=1)] = 255  # the paper stays white
    palette.putpalette(colors.ravel().tolist())
    flat = [image.quantize(palette=palette, dither=Image.Dither.NONE) for image in images]
    options: dict[str, Any] = {"duration": max(round(1000 / fps), 20), "loop": 0, "optimize": False}
    flat[0].save(file, format="GIF", save_all=True, append_images=flat[1:], **options)


def _write_mp4(path: str | Path, file: Path, pictures: Iterator[Numbers], fps: float) -> None:
    """Let ffmpeg write frames; it takes sides of even length alone."""
    first = next(pictures)
    height, width = (side + side % 2 for side in first.shape[:2])
    source = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{width}x{height}", "-r", f"{fps:g}", "-i", "-"]
    target = ["-an", "-pix_fmt", "yuv420p", "-movflags", "+faststart", "-f", "mp4", str(file)]
    command = [_ffmpeg(path), "-y", "-loglevel", "error", *source, *target]
    pipes = {"stdin": subprocess.PIPE, "stderr": subprocess.PIPE, "stdout": subprocess.DEVNULL}
    with subprocess.Popen(command, **pipes) as process:  # type: ignore[call-overload]
        assert process.stdin is not None
        try:
            for pixels in (first, *pictures):
                process.stdin.write(_even(pixels))
        except BrokenPipeError:  # what ffmpeg has to say comes below
            pass
        _, said = process.communicate()
    if process.returncode:
        words = said.decode(errors="replace").strip().splitlines()
        raise KratosLiteError(
            f"{path}: not written: ffmpeg says {words[-1] if words else 'nothing'!r}; try .gif"
        )


def _even(pixels: Numbers) -> bytes:
    """Return the bytes of a picture with white at its lower and right side where a length is odd."""
    height, width, _ = pixels.shape
    return np.pad(pixels, ((0, height % 2), (0, width % 2), (0, 0)), constant_values=255).tobytes()


def _ffmpeg(path: str | Path) -> str:
    """Return the program that writes films."""
    import shutil

    program = shutil.which("ffmpeg")
    if program is None:
        try:
            from imageio_ffmpeg import get_ffmpeg_exe

            program = str(get_ffmpeg_exe())
        except (ImportError, RuntimeError):
            raise KratosLiteError(
                f"{path}: films need ffmpeg: apt install ffmpeg, or pip install imageio-ffmpeg; "
                ".gif needs neither"
            ) from None
    return program
