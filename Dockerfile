# docker build -t vsf-drake .
# docker run --rm -v "$PWD:/work" vsf-drake validate --out results
FROM python:3.12-slim-bookworm
# all that Drake's wheel takes from the system beside the C and C++ libraries
RUN apt-get update && apt-get install -y --no-install-recommends libglib2.0-0 && rm -rf /var/lib/apt/lists/*
COPY . /source
RUN pip install --no-cache-dir /source && rm -r /source
WORKDIR /work
ENTRYPOINT ["vsf-drake"]
