"""OpenCL devices, programs, buffers, structures. Alone imports pyopencl."""
