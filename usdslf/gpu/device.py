"""The OpenCL device: arrays on it, kernels of it, and a clear word where it is missing or too small."""

from __future__ import annotations

import mmap
import os
import threading
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from usdslf.errors import DeviceError, KernelBuildError, MemoryError_
from usdslf.gpu.pages import LARGE, ask_for_large_pages
from usdslf.gpu.pocl_target import name_processor
from usdslf.gpu.source import kernel_source

try:
    import pyopencl as cl
    import pyopencl.array as cla
except ImportError as error:  # the loader itself is missing
    raise DeviceError(f"OpenCL cannot be loaded ({error}); install it with: pip install 'pyopencl[pocl]'") from error


class Kernel:
    """One kernel of a queue, whose arguments are its own."""

    def __init__(self, kernel: Any, queue: Any) -> None:
        self._kernel = kernel
        self._queue = queue
        self._lock = threading.Lock()  # arguments are set one by one, then the kernel is enqueued

    def __call__(self, global_size: tuple[int, ...], local_size: tuple[int, ...] | None, *args: Any) -> None:
        """Enqueues the kernel; arrays of the device are passed as their buffers, Python numbers are not accepted."""
        if min(global_size) == 0:
            return
        plain = [a.base_data if isinstance(a, cla.Array) else getattr(a, "buffer", a) for a in args]
        try:
            with self._lock:
                self._kernel(self._queue, global_size, local_size, *plain)
        except cl.Error as error:
            raise _device_error(error, self._kernel.function_name) from error


class Programs:
    """What was built for a context, by source and macros."""

    def __init__(self) -> None:
        self.built: dict[tuple, Any] = {}
        self.building = threading.Lock()


class Device:
    """An OpenCL device with one in-order queue."""

    def __init__(self, context: Any, programs: Programs | None = None) -> None:
        """Makes the queue; what was built for the context may be that of other devices."""
        self.context = context
        self.queue = cl.CommandQueue(context)
        self._mapping = cl.CommandQueue(context)  # of new arrays, which wait for nothing
        self._programs = programs or Programs()
        self._kernels: dict[tuple, Kernel] = {}
        self.moved = 0  # bytes between host and device so far, those of arrays that are copied (shared.py) too
        self.memory = int(self._info.global_mem_size)
        self.largest_array = int(self._info.max_mem_alloc_size)

    @property
    def _info(self) -> Any:
        return self.context.devices[0]

    @property
    def has_host_memory(self) -> bool:
        """Whether it works in the host's memory, so that arrays can be shared (shared.py)."""
        return bool(self._info.host_unified_memory) and bool(self._info.type & cl.device_type.CPU)

    @property
    def name(self) -> str:
        """Device and platform in words."""
        return f"{self._info.name.strip()} ({self._info.platform.name.strip()})"

    @property
    def driver(self) -> str:
        """Version of what compiles kernels for the device."""
        return f"{self._info.driver_version} {self._info.platform.version}"

    def require(self, size: int, what: str, largest: int = 0) -> None:
        """Raises MemoryError_ where `size` bytes in all, or one array of `largest`, do not fit the device."""
        if size > self.memory or max(largest, 0) > self.largest_array:
            raise MemoryError_(
                f"{what} need {size / 2**30:.1f} GiB (largest array {largest / 2**30:.1f} GiB) but {self.name} has "
                f"{self.memory / 2**30:.1f} GiB (largest array {self.largest_array / 2**30:.1f} GiB); "
                "lower --elements or choose another --device"
            )

    def upload(self, array: ArrayLike) -> Any:
        """Copies a contiguous array to the device; one that is not large waits for nothing that was enqueued before."""
        host = np.ascontiguousarray(array)
        self.moved += host.nbytes
        try:
            if host.size == 0:
                return cla.zeros(self.queue, (1,), host.dtype)
            if host.nbytes < LARGE:
                how = cl.mem_flags.READ_WRITE | cl.mem_flags.COPY_HOST_PTR
                return cla.Array(self.queue, host.shape, host.dtype, data=cl.Buffer(self.context, how, hostbuf=host))
            array_d = self._made(host.shape, host.dtype)
            array_d.set(host, self.queue)
        except cl.Error as error:
            raise _device_error(error, f"an array of {host.nbytes} bytes") from error
        return array_d

    def put(self, array_d: Any, first: int, rows: NDArray) -> None:
        """Copies rows (n, ...) of the host to those of an array on the device from `first` on."""
        self.moved += rows.nbytes
        at = array_d.offset + first * array_d.strides[0]
        cl.enqueue_copy(self.queue, array_d.base_data, np.ascontiguousarray(rows), dst_offset=at)

    def empty(self, shape: tuple[int, ...], dtype: Any) -> Any:
        """Makes an array with no defined content on the device."""
        try:
            return self._made(shape, dtype)
        except cl.Error as error:
            raise _device_error(error, f"an array of shape {shape}") from error

    def zeros(self, shape: tuple[int, ...], dtype: Any) -> Any:
        """Makes an array of zeros on the device."""
        try:
            return cla.zeros(self.queue, shape, dtype)
        except cl.Error as error:
            raise _device_error(error, f"an array of shape {shape}") from error

    def _made(self, shape: tuple[int, ...], dtype: Any) -> Any:
        """An array, in large pages where the device works in the host's memory.

        The memory is the driver's own, which it keeps until all kernels that were enqueued with it are done.
        """
        array_d = cla.empty(self.queue, shape, dtype)
        if self.has_host_memory and array_d.nbytes >= LARGE:
            pages, _ = self._mapped(array_d)
            ask_for_large_pages(pages.ctypes.data, array_d.nbytes)
            pages.base.release(self._mapping)
        return array_d

    def _mapped(self, array_d: Any) -> Any:
        """The bytes of a new array in the host's memory, to be released."""
        how = cl.map_flags.WRITE_INVALIDATE_REGION
        return cl.enqueue_map_buffer(self._mapping, array_d.base_data, how, 0, (array_d.nbytes,), np.uint8)

    def touched(self, shape: tuple[int, ...], dtype: Any) -> Any:
        """Makes an array with no defined content whose memory is there already, on a thread that nobody waits for.

        The first write to a page has the system clear it, which takes longer than most kernels that fill it.
        """
        array_d = self.empty(shape, dtype)
        if self.has_host_memory:
            pages, _ = self._mapped(array_d)
            pages[:: mmap.PAGESIZE] = 0
            pages.base.release(self._mapping)
        return array_d

    @contextmanager
    def written(self, array_d: Any) -> Iterator[NDArray[Any]]:
        """Gives the host memory to write all of a new array of the device to: the array's own where it can be."""
        self.moved += array_d.nbytes
        if not self.has_host_memory:
            host = np.empty(array_d.shape, array_d.dtype)
            yield host
            cl.enqueue_copy(self.queue, array_d.base_data, host)
            return
        how = cl.map_flags.WRITE_INVALIDATE_REGION
        pages, _ = cl.enqueue_map_buffer(self._mapping, array_d.base_data, how, 0, array_d.shape, array_d.dtype)
        try:
            yield pages
        finally:
            pages.base.release(self._mapping).wait()

    def clear(self, array_d: Any) -> None:
        """Fills an array of the device with zeros; safe on several threads, as an array's own `fill` is not."""
        zero = np.zeros(1, array_d.dtype)
        cl.enqueue_fill_buffer(self.queue, array_d.base_data, zero, array_d.offset, array_d.nbytes)

    def copy(self, target_d: Any, source_d: Any) -> None:
        """Copies an array of the device, or a shared one, to another one of its size."""
        target, source = (a.base_data if isinstance(a, cla.Array) else a.buffer for a in (target_d, source_d))
        cl.enqueue_copy(self.queue, target, source)

    def copy_rows(self, target_d: Any, source_d: Any, count: int) -> None:
        """Copies the first rows of an array of the device to the first of another one."""
        size = count * source_d.strides[0]
        cl.enqueue_copy(self.queue, target_d.base_data, source_d.base_data, byte_count=size)

    def download(self, array_d: Any) -> NDArray:
        """Copies an array of the device to the host, after all that was enqueued before."""
        self.moved += array_d.nbytes
        return array_d.get(self.queue)

    def finish(self) -> None:
        """Waits until all that was enqueued is done."""
        self.queue.finish()

    def kernel(self, stem: str, function: str, **constants: Any) -> Kernel:
        """Returns the kernel `function` of kernels/<stem>.cl, built with `constants` as macros."""
        key, built = (stem, *sorted(constants.items())), self._programs.built
        known = self._kernels.get((*key, function))
        if known is not None:  # whatever is being built
            return known
        with self._programs.building:
            if (*key, function) not in self._kernels:
                self._build_once(stem, constants)
                try:
                    made = cl.Kernel(built[key], function)
                except (AttributeError, cl.LogicError):  # what another process was writing to a driver's cache
                    built[key] = self._build(stem, {**constants, "BUILD": os.getpid()})  # not its entry again
                    made = cl.Kernel(built[key], function)
                self._kernels[(*key, function)] = Kernel(made, self.queue)
            return self._kernels[(*key, function)]

    def build(self, stem: str, **constants: Any) -> None:
        """Builds what `kernel` will ask for; without Python's lock, on any thread."""
        with self._programs.building:
            self._build_once(stem, constants)

    def has_built(self, stem: str, **constants: Any) -> bool:
        """Whether `build` has nothing left to do."""
        return (stem, *sorted(constants.items())) in self._programs.built

    def _build_once(self, stem: str, constants: dict[str, Any]) -> None:
        key = (stem, *sorted(constants.items()))
        if key not in self._programs.built:
            self._programs.built[key] = self._build(stem, constants)

    def _build(self, stem: str, constants: dict[str, Any]) -> Any:
        options = ["-cl-std=CL1.2", *(f"-D{name}={value}" for name, value in constants.items())]
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # compilers that talk
            try:
                return cl.Program(self.context, kernel_source(stem)).build(options=options)
            except cl.Error as error:
                first = str(error).strip().splitlines()
                raise KernelBuildError(
                    f"kernels/{stem}.cl does not build on {self.name}: {' '.join(first[:12])[:1500]}; "
                    "update the device's driver or choose another --device"
                ) from error


def list_devices() -> list[tuple[str, int]]:
    """Returns name and memory [bytes] of all OpenCL devices, in the order that `--device` counts them."""
    return [(f"{d.name.strip()} ({d.platform.name.strip()})", int(d.global_mem_size)) for d in _devices()]


def compiled_for() -> list[str]:
    """Returns, for each device, the processor that PoCL was told to compile for; "" where it knows its own."""
    return [name_processor(d.int_ptr) if _is_pocl(d) else "" for d in _devices()]


def _is_pocl(device: Any) -> bool:
    return "Portable Computing Language" in device.platform.name


def _devices() -> list[Any]:
    """All devices, ready to build for."""
    try:
        devices = [d for p in cl.get_platforms() for d in p.get_devices()]
    except cl.Error:
        return []
    for d in devices:
        if _is_pocl(d):
            name_processor(d.int_ptr)
    return devices


def open_device(name: str | None = None) -> Device:
    """Opens an OpenCL device: by number or part of its name, else by PYOPENCL_CTX, else a GPU before a CPU.

    What is built for one of them is built once in a process: half a second for each shot after the first.

    Raises: DeviceError where there is none, or none of that name.
    """
    devices = _devices()
    if not devices:
        raise DeviceError(
            "no OpenCL device was found; install a driver, or the CPU's with: pip install pocl-binary-distribution"
        )
    if name is None and os.environ.get("PYOPENCL_CTX"):
        try:
            return Device(cl.create_some_context(interactive=False))
        except (cl.Error, RuntimeError, ValueError, IndexError) as error:
            raise DeviceError(
                f"PYOPENCL_CTX={os.environ['PYOPENCL_CTX']} names no OpenCL device ({error}); see usdslf doctor"
            ) from error
    if name is None:
        gpus = [d for d in devices if d.type & cl.device_type.GPU]
        return _opened((gpus or devices)[0])
    if name.isdigit():
        chosen = devices[int(name) : int(name) + 1]
    else:
        chosen = [d for d in devices if name.lower() in f"{d.name} ({d.platform.name})".lower()]
    if not chosen:
        known = "; ".join(f"{i}: {d.name.strip()} ({d.platform.name.strip()})" for i, d in enumerate(devices))
        raise DeviceError(f"--device {name} names no OpenCL device; there are {known}")
    return _opened(chosen[0])


_contexts: dict[int, tuple[Any, Programs]] = {}  # by the driver's handle of the device; kept as long as the process


def _opened(device: Any) -> Device:
    if device.int_ptr not in _contexts:
        _contexts.setdefault(device.int_ptr, (cl.Context([device]), Programs()))
    return Device(*_contexts[device.int_ptr])


def _device_error(error: Exception, what: str) -> DeviceError:
    text = str(error).splitlines()[0]
    if "MEM_OBJECT_ALLOCATION" in text or "OUT_OF" in text or "INVALID_BUFFER_SIZE" in text:
        return MemoryError_(f"the OpenCL device has no memory for {what} ({text}); lower --elements")
    return DeviceError(f"the OpenCL device failed on {what} ({text}); try another --device")
