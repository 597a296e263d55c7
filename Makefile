# Everything a newcomer and the continuous integration need, by name.
#
#   make run        install what is missing, build, bring up a YARP network with a simulated arm
#   make test       everything that needs no stock YARP
#   make test-live  ours against stock YARP 3.5.0, which is built first if it is not there
#   make soak       100 000 connections that come and go leave nothing behind
#   make idle       what connections cost that are open and at rest
#   make hour       an hour of the embedded arm at 500 Hz: missed deadlines, ours and the machine's
#   make bench      ours beside stock YARP, with ratios
#   make check      formatting and lints

# Where stock YARP is kept: outside the checkout, so that it is built once.
STOCK ?= $(HOME)/.cache/stock-yarp-3.5.0
export STOCK

.PHONY: run build test test-live soak idle hour bench check setup stock

run: build
	target/release/yarp up

build: setup
	cargo build --release -p yarp-cli

setup:
	@conformance/setup.sh

test: setup check
	cargo test --workspace --all-targets
	cargo test --workspace --doc

check:
	cargo fmt --all --check
	cargo clippy --workspace --all-targets -- -D warnings

stock: setup
	conformance/stock/install.sh "$(STOCK)"

test-live: build stock
	conformance/live/run.sh

soak: setup
	cargo run --release -p yarp-conformance --bin soak

idle: setup
	cargo build --release -p yarp-conformance --bin idle
	ulimit -n 8192 && target/release/idle

# Minutes of `make hour`.
MINUTES ?= 60

hour: setup
	cargo run --release -p yarp-conformance --bin hour -- --minutes $(MINUTES)

bench: stock
	cargo build --release -p yarp-conformance
	conformance/bench/run.sh
