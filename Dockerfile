# The command line: docker build -t fracgyro . && docker run --rm -v "$PWD:/work" fracgyro simulate my.toml
# The stage `notebooks` is that of .devcontainer. Both are installed from the wheel, without a compiler.
FROM python:3.11-slim AS build
RUN apt-get update && apt-get install -y --no-install-recommends g++
COPY . /source
RUN pip wheel --no-cache-dir --no-deps --wheel-dir /wheels /source

FROM python:3.11-slim AS base
COPY --from=build /wheels /wheels
RUN pip install --no-cache-dir "$(ls /wheels/*.whl)[netcdf,rate,report,study]" && useradd --create-home --uid 1000 user

FROM base AS notebooks
RUN apt-get update && apt-get install -y --no-install-recommends git && pip install --no-cache-dir ipykernel jupyterlab
USER user

FROM base
USER user
WORKDIR /work
ENTRYPOINT ["fracgyro"]
CMD ["selfcheck"]
