"""OpenCL: the device and the kernels' text.  The only code that imports pyopencl."""
