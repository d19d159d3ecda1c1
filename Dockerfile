# The command line: docker build -t fracgyro . && docker run --rm -v "$PWD:/work" fracgyro simulate my.toml
FROM python:3.11-slim AS build
RUN apt-get update && apt-get install -y --no-install-recommends g++
COPY . /source
RUN pip wheel --no-cache-dir --no-deps --wheel-dir /wheels /source

FROM python:3.11-slim
COPY --from=build /wheels /wheels
RUN pip install --no-cache-dir "$(ls /wheels/*.whl)[netcdf,rate,report,study]" && useradd --uid 1000 user
USER user
WORKDIR /work
ENTRYPOINT ["fracgyro"]
CMD ["selfcheck"]
