# syntax=docker/dockerfile:1
# A pit in a container:  docker build -t arena .   docker run -p 7447:7447 -p 8000:8000 -v arena-data:/data arena
# All parts of a course, each in one of its own: compose.yaml

FROM python:3.12-slim AS build
WORKDIR /src
RUN python -m venv /opt/arena
COPY pyproject.toml constraints.txt README.md LICENSE ./
COPY arena arena
COPY clients clients
COPY policies policies
COPY tournaments tournaments
# Without `learned`: a pit runs no networks, and torch is larger than everything else together.
RUN /opt/arena/bin/pip install --no-cache-dir --constraint constraints.txt ".[postgres,web]"

FROM python:3.12-slim
# For leagues of strangers' bots; their walls also need a container that may make namespaces, as compose.yaml has it for its season.
# hadolint ignore=DL3008  # a version that was pinned is gone from Debian's servers with the next
RUN apt-get update && apt-get install -y --no-install-recommends bubblewrap && rm -rf /var/lib/apt/lists/*
RUN useradd --create-home --uid 1000 arena && install --directory --owner=arena /data /kernels
COPY --from=build /opt/arena /opt/arena
# Keys of entries and pits that are trusted live in the volume, too: whoever loses them is another entry.
ENV PATH=/opt/arena/bin:$PATH ARENA_CONFIG=/data/config NUMBA_CACHE_DIR=/kernels PYTHONUNBUFFERED=1
# By its number, so that a system that lets no root in knows that this is none.
USER 1000
# Kernels are compiled for the processor that builds the image; another kind compiles them anew at its first start.
RUN arena doctor --compile && arena play rush patrol --pairs 1 --workers 1
VOLUME /data
EXPOSE 7447 8000 9100
HEALTHCHECK --interval=30s --timeout=10s --start-period=60s \
    CMD ["python", "-c", "from urllib.request import urlopen; urlopen('http://127.0.0.1:9100/healthz', timeout=8)"]
STOPSIGNAL SIGTERM
ENTRYPOINT ["arena"]
CMD ["serve", "--listen", "tcp/0.0.0.0:7447", "--data", "/data", "--metrics", "0.0.0.0:9100", "--web", "8000", "--web-host", "0.0.0.0", "--web-name", "localhost"]
