"""How the C library is to hand out memory to a process that trains."""

KEEP = {"MALLOC_MMAP_THRESHOLD_": "1073741824", "MALLOC_TRIM_THRESHOLD_": "1073741824", "MALLOC_TOP_PAD_": "268435456"}
"""Environment variables of glibc, in bytes: kept memory is cheaper than fresh memory, which would be mapped and faulted in for
every large tensor anew.
"""
