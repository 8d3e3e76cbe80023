"""GlPicture: scene-linear frames in OpenGL, their mean, and the display pass over it.

    with picture.linear(): ...      what is drawn within goes into the linear frame; waits until it is there
    picture.add(number)             the frame into the mean of `number` frames
    picture.codes(pass, settings)   the mean through the display pass, as a QImage
    picture.pixels()                the mean, scene-linear

Needs a current context of OpenGL 4, compatibility profile; all calls on its thread.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
from numpy.typing import NDArray
from PySide6.QtGui import QImage, QOpenGLContext, QOpenGLExtraFunctions
from PySide6.QtOpenGL import (
    QOpenGLFramebufferObject,
    QOpenGLFramebufferObjectFormat,
    QOpenGLShader,
    QOpenGLShaderProgram,
    QOpenGLTexture,
    QOpenGLTimerQuery,
)

from usdslf import CHANNELS, DisplayPass, DisplaySettings, DisplayShader

# Values of OpenGL's constants that Qt has no names for.
COLOR_BIT, DEPTH_BIT, STENCIL_BIT = 0x4000, 0x100, 0x400
BLEND, CULL_FACE, DEPTH_TEST, SCISSOR_TEST, STENCIL_TEST = 0x0BE2, 0x0B44, 0x0B71, 0x0C11, 0x0B90
TEXTURE_2D, TEXTURE0, TRIANGLES = 0x0DE1, 0x84C0, 4
CONSTANT_ALPHA, ONE_MINUS_CONSTANT_ALPHA = 0x8003, 0x8004
RGBA8, RGBA16F, RGBA32F = 0x8058, 0x881A, 0x8814
POLL = 0.001  # seconds between looks whether a frame is there
VERTEX = """#version 400 compatibility
void main() { gl_Position = vec4(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0, 0.0, 1.0); }
"""
COPY = """#version 400 compatibility
uniform sampler2D frame;
void main() { gl_FragColor = texelFetch(frame, ivec2(gl_FragCoord.xy), 0); }
"""
SHOW = """#version 400 compatibility
uniform sampler2D frame;
uniform float exposure;
uniform float gamma;
uniform int channel;
%s
void main()
{
  vec3 rgb = texelFetch(frame, ivec2(gl_FragCoord.xy), 0).rgb;
  gl_FragColor = vec4(usdslf_display(rgb, exposure, gamma, channel), 1.0);
}
"""


class GlPicture:
    """Frames of one size at a time, and what is made of them."""

    def __init__(self) -> None:
        self._functions = QOpenGLExtraFunctions(QOpenGLContext.currentContext())
        self._drawn = QOpenGLTimerQuery()
        self._drawn.create()
        self._size = (0, 0)
        self._frame: QOpenGLFramebufferObject | None = None
        self._mean: QOpenGLFramebufferObject | None = None
        self._shown: QOpenGLFramebufferObject | None = None
        self._copy = _program(COPY)
        self._show: QOpenGLShaderProgram | None = None
        self._shader: DisplayShader | None = None
        self._tables: list[tuple[str, QOpenGLTexture]] = []

    def resize(self, size: tuple[int, int]) -> None:
        """Makes room for frames of a width and height [pixels]."""
        if size == self._size:
            return
        self._size = size
        self._frame = _framebuffer(size, RGBA16F, QOpenGLFramebufferObject.Attachment.CombinedDepthStencil)
        self._mean = _framebuffer(size, RGBA32F)
        self._shown = _framebuffer(size, RGBA8)

    @contextmanager
    def linear(self) -> Iterator[None]:
        """Binds the linear frame, empty, for what is drawn within."""
        assert self._frame is not None
        gl = self._functions
        self._frame.bind()
        gl.glViewport(0, 0, *self._size)
        gl.glDisable(SCISSOR_TEST)
        gl.glColorMask(True, True, True, True)
        gl.glDepthMask(True)
        gl.glClearColor(0, 0, 0, 0)
        gl.glClear(COLOR_BIT | DEPTH_BIT | STENCIL_BIT)
        try:
            yield
        finally:
            self._frame.release()
            self._wait()

    def add(self, number: int) -> None:
        """Makes the frame the last of `number` that the mean is of; 1: the mean is this frame."""
        assert self._frame is not None and self._mean is not None
        gl = self._functions
        with self._drawing(self._mean, self._copy, self._frame):
            if number > 1:
                gl.glEnable(BLEND)
                gl.glBlendColor(0, 0, 0, 1 / number)
                gl.glBlendFunc(CONSTANT_ALPHA, ONE_MINUS_CONSTANT_ALPHA)
            gl.glDrawArrays(TRIANGLES, 0, 3)
            gl.glDisable(BLEND)

    def codes(self, display: DisplayPass, settings: DisplaySettings) -> QImage:
        """Returns the mean as code values of the screen.

        Raises: InputError where the config has no such display, view or look.
        """
        assert self._mean is not None and self._shown is not None
        self._prepare(display)
        assert self._show is not None
        with self._drawing(self._shown, self._show, self._mean):
            self._show.setUniformValue1f(self._show.uniformLocation("exposure"), settings.exposure)
            self._show.setUniformValue1f(self._show.uniformLocation("gamma"), settings.gamma)
            self._show.setUniformValue1i(self._show.uniformLocation("channel"), CHANNELS.index(settings.channel))
            for unit, (name, table) in enumerate(self._tables, start=1):
                table.bind(unit)
                self._functions.glBindSampler(unit, 0)
                self._show.setUniformValue1i(self._show.uniformLocation(name), unit)
            self._functions.glDrawArrays(TRIANGLES, 0, 3)
        return self._shown.toImage().convertToFormat(QImage.Format.Format_RGB32)

    def pixels(self) -> NDArray[np.float32]:
        """Returns the mean (h, w, 3), scene-linear."""
        assert self._mean is not None
        image = self._mean.toImage()
        if image.format() not in (QImage.Format.Format_RGBA32FPx4, QImage.Format.Format_RGBA32FPx4_Premultiplied):
            image = image.convertToFormat(QImage.Format.Format_RGBA32FPx4_Premultiplied)
        rows = np.frombuffer(image.constBits(), np.float32).reshape(image.height(), -1, 4)
        return rows[:, : image.width(), :3].copy()

    def put(self, pixels: NDArray) -> None:
        """Makes the frame from scene-linear pixels (h, w, 3), as if they had been drawn."""
        height, width = pixels.shape[:2]
        self.resize((width, height))
        assert self._mean is not None
        rgba = np.ones((height, width, 4), np.float32)
        rgba[..., :3] = pixels[::-1]
        texture = QOpenGLTexture(QOpenGLTexture.Target.Target2D)
        texture.setFormat(QOpenGLTexture.TextureFormat.RGBA32F)
        texture.setSize(width, height)
        texture.setMinMagFilters(QOpenGLTexture.Filter.Nearest, QOpenGLTexture.Filter.Nearest)
        texture.allocateStorage(QOpenGLTexture.PixelFormat.RGBA, QOpenGLTexture.PixelType.Float32)
        _load(texture, QOpenGLTexture.PixelFormat.RGBA, rgba)
        with self._drawing(self._mean, self._copy, texture):
            self._functions.glDrawArrays(TRIANGLES, 0, 3)
        texture.destroy()

    def release(self) -> None:
        """Gives back all that it holds; the context is current."""
        for _, table in self._tables:
            table.destroy()
        self._tables, self._show, self._shader = [], None, None
        self._frame = self._mean = self._shown = None
        del self._copy, self._drawn

    # ── how ────────────────────────────────────────────────────────────────────────────────────
    @contextmanager
    def _drawing(
        self, into: QOpenGLFramebufferObject, program: QOpenGLShaderProgram,
        of: QOpenGLFramebufferObject | QOpenGLTexture,
    ) -> Iterator[None]:  # fmt: skip
        """Binds all that a triangle over the whole picture needs; Hydra leaves its own state behind."""
        gl = self._functions
        into.bind()
        gl.glViewport(0, 0, *self._size)
        for state in (BLEND, CULL_FACE, DEPTH_TEST, SCISSOR_TEST, STENCIL_TEST):
            gl.glDisable(state)
        gl.glColorMask(True, True, True, True)
        gl.glBindVertexArray(0)
        program.bind()
        gl.glActiveTexture(TEXTURE0)
        gl.glBindSampler(0, 0)
        gl.glBindTexture(TEXTURE_2D, of.textureId() if isinstance(of, QOpenGLTexture) else of.texture())
        program.setUniformValue1i(program.uniformLocation("frame"), 0)
        try:
            yield
        finally:
            gl.glActiveTexture(TEXTURE0)
            gl.glBindTexture(TEXTURE_2D, 0)
            program.release()
            into.release()

    def _wait(self) -> None:
        """Waits until all is drawn, without holding Python's lock, as any call that needs the result would."""
        self._drawn.recordTimestamp()
        self._functions.glFlush()
        while not self._drawn.isResultAvailable():
            time.sleep(POLL)

    def _prepare(self, display: DisplayPass) -> None:
        """Compiles the shader of a display pass and loads its table, where they are not there."""
        shader = display.shader
        if shader is self._shader:
            return
        for _, table in self._tables:
            table.destroy()
        self._show = _program(SHOW % shader.text)
        self._tables = [(t.name, _table(t.values)) for t in shader.textures]
        self._shader = shader


def _program(fragment: str) -> QOpenGLShaderProgram:
    program = QOpenGLShaderProgram()
    kinds = QOpenGLShader.ShaderTypeBit
    compiled = program.addShaderFromSourceCode(kinds.Vertex, VERTEX)
    compiled = compiled and program.addShaderFromSourceCode(kinds.Fragment, fragment)
    if not (compiled and program.link()):
        raise RuntimeError(f"the display pass cannot be compiled by this OpenGL: {program.log()}")
    return program


def _framebuffer(
    size: tuple[int, int], kind: int,
    depth: QOpenGLFramebufferObject.Attachment = QOpenGLFramebufferObject.Attachment.NoAttachment,
) -> QOpenGLFramebufferObject:  # fmt: skip
    described = QOpenGLFramebufferObjectFormat()
    described.setInternalTextureFormat(kind)
    described.setAttachment(depth)
    return QOpenGLFramebufferObject(*size, described)


def _table(values: NDArray[np.float32]) -> QOpenGLTexture:
    """A cube of colours (n, n, n, 3) as a texture; the last axis of places is its first coordinate."""
    depth, height, width, _ = values.shape
    texture = QOpenGLTexture(QOpenGLTexture.Target.Target3D)
    texture.setFormat(QOpenGLTexture.TextureFormat.RGB32F)
    texture.setSize(width, height, depth)
    texture.setMinMagFilters(QOpenGLTexture.Filter.Nearest, QOpenGLTexture.Filter.Nearest)
    texture.setWrapMode(QOpenGLTexture.WrapMode.ClampToEdge)
    texture.setAutoMipMapGenerationEnabled(False)
    texture.allocateStorage(QOpenGLTexture.PixelFormat.RGB, QOpenGLTexture.PixelType.Float32)
    _load(texture, QOpenGLTexture.PixelFormat.RGB, values)
    return texture


def _load(texture: QOpenGLTexture, kind: QOpenGLTexture.PixelFormat, values: NDArray[np.float32]) -> None:
    data = values.tobytes()  # Qt takes any buffer, whatever its stubs say
    texture.setData(kind, QOpenGLTexture.PixelType.Float32, data)  # type: ignore[call-overload]
