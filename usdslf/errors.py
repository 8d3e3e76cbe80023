"""Errors that a user can mend, and the exit code of each.

    UsdslfError            1
      InputError           2   bad file, bad value, bad usage
        StageError         2   the shot
        StrokeError        2   the stroke layer
      SchemaError          3   the schema plugin could not be registered
      DeviceError          4   no OpenCL device, or it failed
        MemoryError_       4   the problem is too large for the device
        KernelBuildError   4   a kernel did not compile
      SolveError           5   nothing to solve, or no solution that is finite
      AuthorError          6   the edit cannot be written

Each message is one sentence that says what, where (file and prim) and how to mend it.  Programmer
errors are asserts, not these.
"""


class UsdslfError(Exception):
    """Base of all errors that are the user's to mend."""

    exit_code = 1


class InputError(UsdslfError):
    """A file, value or argument that cannot be used."""

    exit_code = 2


class StageError(InputError):
    """The shot cannot be opened, or holds nothing to work on."""


class StrokeError(InputError):
    """The stroke layer cannot be read, or a stroke says nothing that can be used."""


class SchemaError(UsdslfError):
    """The stroke schema could not be registered."""

    exit_code = 3


class DeviceError(UsdslfError):
    """No OpenCL device, or the device failed."""

    exit_code = 4


class MemoryError_(DeviceError):
    """The problem does not fit the device."""


class KernelBuildError(DeviceError):
    """An OpenCL kernel did not compile on the device."""


class SolveError(UsdslfError):
    """The strokes have no solution that can be stated."""

    exit_code = 5


class AuthorError(UsdslfError):
    """The look layer cannot be written."""

    exit_code = 6
