# Everything a newcomer and the continuous integration need, by name.
#
#   make run        install what is missing, build, bring up a YARP network with a simulated arm
#   make tidy       the same with a simulated table, which the arm tidies; needs OpenCV, which it installs
#   make test       everything that needs no stock YARP
#   make test-etcd  several name servers that share their names in etcd, which is installed if it is missing
#   make test-live  ours against stock YARP 3.5.0, which is built first if it is not there
#   make test-gui   stock's yarpmotorgui and yarpview on our devices, by hand: builds them with Qt first
#   make test-can   the CAN driver of the arm on a bus of Debian's kernel, booted in QEMU (about a minute)
#   make test-camera  the drivers of cameras on the virtual camera and the virtual USB of Debian's kernel, booted in QEMU (about two minutes)
#   make test-iidc    the second half of it: the driver of IIDC cameras
#   make test-rt    the arm's real-time settings on Debian's kernel with PREEMPT_RT and on the ordinary one, by hand
#   make soak       100 000 connections that come and go leave nothing behind
#   make abuse      16 MB of each kind of abuse against a running arm: its memory, round trips and state stream
#   make idle       what connections cost that are open and at rest
#   make hour       an hour of the embedded arm at 500 Hz: missed deadlines, ours and the machine's
#   make bench      ours beside stock YARP, with ratios
#   make check      formatting, lints, links of the documentation, vocabulary and structure of the sources
#   make deny       licences and sources of the dependencies
#   make features   builds each library alone, with each of its features
#   make msrv       checks with the oldest Rust that the manifest promises
#   make package    makes the packages of all published crates

# Where stock YARP is kept: outside the checkout, so that it is built once.
STOCK ?= $(HOME)/.cache/stock-yarp-3.5.0
export STOCK

# `make build FEATURES=etcd` builds `yarp server --store etcd://...`; needs protoc (conformance/etcd/setup.sh).
FEATURES ?=
# Tests cover the simulated table and OpenCV, too.
WORKSPACE_FEATURES = --features yarp-cli/table,yarp-cli/vision$(if $(FEATURES),$(COMMA)yarp-cli/$(FEATURES))
COMMA = ,

# Where stock's graphical tools are kept.
WINDOWS ?= $(HOME)/.cache/stock-yarp-windows

# Most tests wait for time to pass, for motions and deadlines.
RUST_TEST_THREADS ?= 4
export RUST_TEST_THREADS

# The oldest Rust that builds the workspace; the manifest promises it.
OLDEST_RUST := $(shell sed -n 's/^rust-version = "\(.*\)"/\1/p' Cargo.toml)

.PHONY: msrv run tidy build features package test test-etcd test-live test-gui test-can test-camera test-iidc test-rt soak idle hour bench check deny setup setup-vision stock abuse

run: build
	target/release/yarp up

# The table is watched in a browser: at the speed of a real robot.
tidy: setup-vision
	cargo build --release -p yarp-cli --features table,vision
	target/release/yarp demo tidy --shared --speed 1 $(TIDY)

build: setup
	cargo build --release -p yarp-cli $(if $(FEATURES),--features $(FEATURES))

setup:
	@conformance/setup.sh

# OpenCV, which the workspace's tests need and `make run` does not.
setup-vision:
	@conformance/setup.sh vision

test: setup-vision check
	cargo test --workspace $(WORKSPACE_FEATURES)

check: setup-vision
	cargo fmt --all --check
	cargo clippy --workspace --all-targets $(WORKSPACE_FEATURES) -- -D warnings
	RUSTDOCFLAGS="-D warnings" cargo doc --no-deps --workspace $(WORKSPACE_FEATURES)
	conformance/style.py check

# Each crate alone, with each of its features.
features: setup
	conformance/features.sh

# With the oldest Rust, in a folder of its own: its results are of no use to another Rust.
msrv: setup
	rustup toolchain install --profile minimal $(OLDEST_RUST)
	CARGO_TARGET_DIR=target/msrv cargo +$(OLDEST_RUST) check --workspace --features yarp-cli/table

# The packages of all published crates.
package: setup
	cargo package --workspace --exclude yarp-conformance --exclude yarp-testing --no-verify

deny: setup
	command -v cargo-deny >/dev/null || cargo install --locked cargo-deny
	cargo deny check bans licenses sources

# What is built here `make test FEATURES=etcd` has built by then.
test-etcd: setup-vision
	conformance/etcd/setup.sh
	cargo test --workspace --features yarp-cli/table,yarp-cli/vision,yarp-cli/etcd --no-run
	conformance/etcd/run.sh

stock: setup
	conformance/stock/install.sh "$(STOCK)"

# `PROFILE=dev` tries what `make test FEATURES=etcd` built, instead of a release. `PARTS=1` runs four parts at once, which needs root.
PROFILE ?= release

test-live: $(if $(filter dev,$(PROFILE)),setup,build) stock
	PROFILE=$(PROFILE) conformance/live/$(if $(PARTS),in_parts,run).sh

# Debian's Python has what reads windows.
test-gui: build stock
	conformance/gui/install.sh "$(WINDOWS)"
	/usr/bin/python3 -B conformance/gui/check.py target/release/yarp "$(WINDOWS)"

test-can: setup
	conformance/can/run.sh

test-camera: setup
	conformance/camera/run.sh
	conformance/iidc/run.sh

test-iidc: setup
	conformance/iidc/run.sh

# By hand: prints the delays of both kernels, and asserts none.
test-rt: setup
	conformance/rt/run.sh

soak: setup
ifeq ($(PROFILE),dev)
	cargo build --workspace $(WORKSPACE_FEATURES)
	target/debug/soak
else
	cargo run --release -p yarp-conformance --bin soak
endif

abuse: build
	cargo build --release -p yarp-conformance --bin abuse
	target/release/abuse target/release/yarp
	target/release/abuse target/release/yarp silent

idle: setup
	cargo build --release -p yarp-conformance --bin idle
	ulimit -n 16384 && target/release/idle

# Minutes of `make hour`.
MINUTES ?= 60

hour: setup
	cargo run --release -p yarp-conformance --bin hour -- --minutes $(MINUTES)

bench: stock
	cargo build --release -p yarp-conformance
	conformance/bench/run.sh
