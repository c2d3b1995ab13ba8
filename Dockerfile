# The wheel is built in the first stage; the second one has the tool and its libraries alone.
FROM python:3.13-slim AS build
WORKDIR /source
COPY pyproject.toml README.md CHANGELOG.md CITATION.cff LICENSE MANIFEST.in build_backend.py ./
COPY build_kernels build_kernels
COPY uavseg uavseg
# The image may run on another processor than this one.
ENV UAVSEG_BUILD_KERNELS=all
RUN pip wheel --no-cache-dir --no-deps --wheel-dir /wheels .

FROM python:3.13-slim
# The wheels of rasterio take this library from the system, and the image has none.
# hadolint ignore=DL3008
RUN apt-get update \
    && apt-get install --yes --no-install-recommends libexpat1 \
    && rm -rf /var/lib/apt/lists/*
COPY --from=build /wheels /wheels
RUN pip install --no-cache-dir "$(echo /wheels/*.whl)[serial]" \
    && rm -r /wheels \
    && useradd --create-home --uid 1000 pilot
USER 1000
# A user without a home, such as of `docker run --user`, has its caches here.
ENV MPLCONFIGDIR=/tmp/matplotlib
WORKDIR /data
RUN uavseg doctor
ENTRYPOINT ["uavseg"]
CMD ["--help"]
