# syntax=docker/dockerfile:1
# A pit in a container:  docker build -t arena .   docker run -p 7447:7447 -v arena-data:/data arena

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
# For leagues of strangers' bots; their walls also need a container that may make namespaces, as by --security-opt seccomp=unconfined.
RUN apt-get update && apt-get install -y --no-install-recommends bubblewrap && rm -rf /var/lib/apt/lists/*
RUN useradd --create-home --uid 1000 arena && install --directory --owner=arena /data /kernels
COPY --from=build /opt/arena /opt/arena
ENV PATH=/opt/arena/bin:$PATH NUMBA_CACHE_DIR=/kernels PYTHONUNBUFFERED=1
USER arena
# Kernels are compiled for the processor that builds the image; another kind compiles them anew at its first start.
RUN arena doctor --compile && arena play rush patrol --pairs 1 --workers 1
VOLUME /data
EXPOSE 7447
HEALTHCHECK --interval=30s --timeout=15s --start-period=20s CMD ["arena", "doctor", "--pit", "tcp/127.0.0.1:7447"]
STOPSIGNAL SIGTERM
ENTRYPOINT ["arena"]
CMD ["serve", "--listen", "tcp/0.0.0.0:7447", "--data", "/data"]
