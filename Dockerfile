# Fleet2D with its page and pictures, without a compiler: the wheel is built in a stage of its own.
#   docker build -t fleet2d .
#   docker run --rm -v "$PWD:/work" fleet2d run --out month
#   docker run --rm -v "$PWD:/work" --network host fleet2d view month --port 8000 --no-browser
FROM python:3.13-slim-bookworm AS build
RUN apt-get update && apt-get install -y --no-install-recommends g++ && rm -rf /var/lib/apt/lists/*
COPY . /src
RUN pip wheel --no-cache-dir --no-deps --wheel-dir /wheels /src

FROM python:3.13-slim-bookworm
COPY --from=build /wheels /wheels
RUN pip install --no-cache-dir "$(echo /wheels/*.whl)[viz,view,pandas]" && rm -rf /wheels \
    && useradd --create-home fleet2d && install -d -o fleet2d /work
USER fleet2d
WORKDIR /work
ENTRYPOINT ["fleet2d"]
CMD ["--help"]
