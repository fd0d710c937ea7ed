# syntax=docker/dockerfile:1
# The pit in a box:  docker build -t arena .   docker run -p 7447:7447 -v arena-data:/data arena

FROM python:3.12-slim AS build
WORKDIR /src
COPY pyproject.toml constraints.txt README.md LICENSE ./
RUN python -m venv /opt/arena
# --build-arg TORCH_INDEX=... takes torch from another index: the CPU build is some gigabytes smaller, and a pit does not train.
ARG TORCH_INDEX=
RUN /opt/arena/bin/pip install --no-cache-dir --constraint constraints.txt ${TORCH_INDEX:+--index-url "$TORCH_INDEX"} torch
COPY arena arena
COPY clients clients
COPY policies policies
COPY tournaments tournaments
RUN /opt/arena/bin/pip install --no-cache-dir --constraint constraints.txt ".[postgres]"

FROM python:3.12-slim
RUN useradd --create-home --uid 1000 arena && install --directory --owner=arena /data /kernels
COPY --from=build /opt/arena /opt/arena
ENV PATH=/opt/arena/bin:$PATH NUMBA_CACHE_DIR=/kernels PYTHONUNBUFFERED=1
USER arena
# Kernels are compiled for the machine that builds the image; on another kind they are compiled anew at the first match.
RUN arena play rush patrol --pairs 1 --workers 1 && arena doctor
VOLUME /data
EXPOSE 7447
HEALTHCHECK --interval=30s --timeout=15s --start-period=20s CMD ["arena", "doctor", "--pit", "tcp/127.0.0.1:7447"]
STOPSIGNAL SIGTERM
ENTRYPOINT ["arena"]
CMD ["serve", "--listen", "tcp/0.0.0.0:7447", "--data", "/data"]
