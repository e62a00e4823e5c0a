# The environment of fenics_forming for everyone who is not on Debian 13: docker build -t fenics_forming .
FROM debian:trixie
COPY env/debian-packages.txt env/python-packages.txt /tmp/env/
RUN apt-get update \
 && sed -e 's/#.*//' /tmp/env/debian-packages.txt | xargs apt-get install -y --no-install-recommends \
 && rm -rf /var/lib/apt/lists/* \
 && python3 -m venv --system-site-packages /opt/venv \
 && sed -e 's/#.*//' /tmp/env/python-packages.txt | xargs /opt/venv/bin/pip install --no-cache-dir
ENV PATH=/opt/venv/bin:$PATH OMP_NUM_THREADS=1 OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1
COPY . /src
RUN /opt/venv/bin/pip install --no-cache-dir --no-build-isolation --no-deps /src
WORKDIR /work
ENTRYPOINT ["forming"]
