"""Code that runs on devices: OpenCL sources and their host side."""
