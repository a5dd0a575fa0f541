# The program alone, for a machine without Rust. Nothing is fetched when it runs.
#
#   docker build --tag dynident .
#   docker run --rm --network none --user "$(id -u):$(id -g)" --volume "$PWD:/data" dynident identify study.toml --out result
#
# The first stage builds a static program for the machine's own processor.
FROM rust:1.95-alpine AS build
# The C library's headers, and a compiler of C for Zstandard and LZ4.
RUN apk add --no-cache musl-dev gcc make
WORKDIR /source
COPY . .
RUN cargo build --profile dist --locked --package dynident-cli \
    && target/dist/dynident --version

# A folder for temporary files, and a shell to look around; nothing is installed.
FROM alpine:3.22
COPY --from=build /source/target/dist/dynident /usr/local/bin/dynident
COPY --from=build /source/LICENSE-MIT /source/LICENSE-APACHE /usr/share/doc/dynident/
# Nobody: whoever mounts a folder to write into gives the owner's number by --user.
USER 65534:65534
WORKDIR /data
ENTRYPOINT ["/usr/local/bin/dynident"]
CMD ["--help"]
